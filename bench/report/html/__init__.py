"""report.html: one file that works offline and without scripts."""
