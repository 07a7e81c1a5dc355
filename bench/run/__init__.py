"""Run algorithms over logs in separate processes, and measure their cost."""
