#include "boot_count.h"

#include <avr/io.h>

namespace hal {

namespace {

constexpr uint16_t COUNT_ADDRESS = 0;

void wait_ready() {
    while (EECR & _BV(EEPE)) {
    }
}

uint8_t read_byte(uint16_t address) {
    wait_ready();
    EEAR = address;
    EECR |= _BV(EERE);
    return EEDR;
}

// Interrupts must be off: EEPE has to follow EEMPE within four cycles (ATmega328P datasheet, 7.6.3).
void write_byte(uint16_t address, uint8_t value) {
    wait_ready();
    EEAR = address;
    EEDR = value;
    EECR |= _BV(EEMPE);
    EECR |= _BV(EEPE);
}

}  // namespace

uint32_t count_boot() {
    uint32_t count = 0;
    for (uint16_t i = 4; i-- > 0;) count = (count << 8) | read_byte(COUNT_ADDRESS + i);
    ++count;
    // The highest byte first: a count cut short by a reset is then larger than the last one, never one used
    // before.
    for (uint16_t i = 4; i-- > 0;) {
        const uint8_t byte = static_cast<uint8_t>(count >> (8 * i));
        if (byte != read_byte(COUNT_ADDRESS + i)) write_byte(COUNT_ADDRESS + i, byte);
    }
    wait_ready();
    return count;
}

}  // namespace hal
