"""What slams compare makes before it writes it."""

from unittest import mock

from bench import compare


def compared(words):
    """Run the command; the comparison behind its files."""
    with mock.patch.object(compare, "_write", wraps=compare._write) as write:
        assert compare.main(words) == 0
    return write.call_args.args[1]
