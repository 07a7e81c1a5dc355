from tests.live.commands import started

__all__ = ["started"]
