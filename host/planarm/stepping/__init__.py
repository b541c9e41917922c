"""Motion to steps: exact step times, their compression into segments, and the certificate of the result."""
