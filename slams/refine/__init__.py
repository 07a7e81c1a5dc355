"""What is ours behind the papers: lines in cells, and a scan fitted to them."""
