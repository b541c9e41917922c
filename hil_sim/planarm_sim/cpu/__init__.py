"""The ATmega328P: instruction set, interrupts, data space."""
