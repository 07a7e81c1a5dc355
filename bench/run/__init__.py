"""Do the work: one algorithm over one log, in processes of their own, with what it cost."""
