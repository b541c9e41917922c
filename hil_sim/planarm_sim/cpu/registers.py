"""I/O registers of the ATmega328P: addresses in the data space, and names (datasheet, 36 Register Summary)."""

from __future__ import annotations

import numpy as np

PINB, DDRB, PORTB = 0x23, 0x24, 0x25
PINC, DDRC, PORTC = 0x26, 0x27, 0x28
PIND, DDRD, PORTD = 0x29, 0x2A, 0x2B
TIFR0, TIFR1, TIFR2 = 0x35, 0x36, 0x37
PCIFR, EIFR, EIMSK = 0x3B, 0x3C, 0x3D
GPIOR0, GPIOR1, GPIOR2 = 0x3E, 0x4A, 0x4B
EECR, EEDR, EEARL, EEARH = 0x3F, 0x40, 0x41, 0x42
GTCCR = 0x43
TCCR0A, TCCR0B, TCNT0, OCR0A, OCR0B = 0x44, 0x45, 0x46, 0x47, 0x48
SPCR, SPSR, SPDR = 0x4C, 0x4D, 0x4E
ACSR = 0x50
SMCR, MCUSR, MCUCR = 0x53, 0x54, 0x55
SPMCSR = 0x57
SPL, SPH, SREG = 0x5D, 0x5E, 0x5F
WDTCSR, CLKPR, PRR, OSCCAL = 0x60, 0x61, 0x64, 0x66
PCICR, EICRA = 0x68, 0x69
PCMSK0, PCMSK1, PCMSK2 = 0x6B, 0x6C, 0x6D
TIMSK0, TIMSK1, TIMSK2 = 0x6E, 0x6F, 0x70
ADCL, ADCH, ADCSRA, ADCSRB, ADMUX = 0x78, 0x79, 0x7A, 0x7B, 0x7C
DIDR0, DIDR1 = 0x7E, 0x7F
TCCR1A, TCCR1B, TCCR1C = 0x80, 0x81, 0x82
TCNT1L, TCNT1H, ICR1L, ICR1H = 0x84, 0x85, 0x86, 0x87
OCR1AL, OCR1AH, OCR1BL, OCR1BH = 0x88, 0x89, 0x8A, 0x8B
TCCR2A, TCCR2B, TCNT2, OCR2A, OCR2B = 0xB0, 0xB1, 0xB2, 0xB3, 0xB4
ASSR = 0xB6
TWBR, TWSR, TWAR, TWDR, TWCR, TWAMR = 0xB8, 0xB9, 0xBA, 0xBB, 0xBC, 0xBD
UCSR0A, UCSR0B, UCSR0C = 0xC0, 0xC1, 0xC2
UBRR0L, UBRR0H, UDR0 = 0xC4, 0xC5, 0xC6

NAMES: dict[int, str] = {
    value: name for name, value in list(globals().items()) if name.isupper() and isinstance(value, int)
}

IO_START, SRAM_START, SRAM_END = 0x20, 0x100, 0x900
"""The data space: 32 registers, I/O and extended I/O from IO_START, 2 KiB of SRAM, nothing from SRAM_END on."""
EEPROM_START, EEPROM_BYTES = SRAM_END - SRAM_START, 1024
"""Where the EEPROM stands in the array that holds both memories, behind the SRAM."""

# Registers that read as they were last written, whatever the time; the general registers among them.
READS_PLAIN = np.zeros(256, dtype=np.bool_)
for _first, _last in (
    *((0, 31), (DDRB, PORTB), (DDRC, PORTC), (DDRD, PORTD), (EIMSK, GPIOR0), (EEDR, TCCR0B), (OCR0A, OCR0B)),
    *((GPIOR1, GPIOR2), (SMCR, MCUCR), (PCICR, EICRA), (PCMSK0, TIMSK2), (TCCR1A, TCCR1C), (OCR1AL, OCR1BH)),
    *((TCCR2A, TCCR2B), (OCR2A, OCR2B), (UCSR0C, UBRR0H)),
):
    READS_PLAIN[_first : _last + 1] = True
READS_PLAIN[[0x49, 0xC3]] = False  # no registers
READS_PLAIN[PRR] = True
