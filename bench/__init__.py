"""The benchmark; it uses algorithms only through the registry."""
