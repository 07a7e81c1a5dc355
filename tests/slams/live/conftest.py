from tests.slams.live.commands import started

__all__ = ["started"]
