"""The ATmega328P's peripherals, as kernels over one state array."""
