"""Front end: what the algorithms share between a scan and its pose; no algorithm is known here."""
