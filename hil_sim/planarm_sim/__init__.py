"""An emulated Arduino Uno."""
