"""One benchmark over one scan log; knows algorithms only by their names in the registry."""
