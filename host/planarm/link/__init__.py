"""The way to the device: bytes (transport), order (arq), meaning (session), pace (stream), and the loop over them."""
