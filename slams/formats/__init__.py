"""One file per family of file formats."""
