"""Files other than printed numbers: measurements, the star catalogue, slow studies."""
