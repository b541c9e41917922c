#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal_flash.h"
#include "hal_pins.h"
#include "hal_step_timer.h"
#include "joints.h"
#include "polarity.h"
#include "ports.h"
#include "wiring.h"

namespace hal {

namespace wire = planarm::wire;
using planarm::for_each_joint;

namespace {

bool enable_active_high;

// Each joint's DIR: its mask, and the address of PINx; PORTx is two behind. A one that is written to PINx
// turns PORTx's bit over.
constexpr uint16_t turning(uint8_t pin) {
    return static_cast<uint16_t>(mask_of(pin) << 8 | (static_cast<uint8_t>(port_of(pin)) - 2 + __SFR_OFFSET));
}

struct DirPins {
    uint16_t of[wire::JOINTS];
};

constexpr DirPins find_dir_pins() {
    DirPins pins{};
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) pins.of[joint] = turning(wire::DIR_PINS[joint]);
    return pins;
}

constexpr DirPins dir_pins HAL_FLASH = find_dir_pins();

}  // namespace

bool dir_set(uint8_t joint, bool high) {
    const uint16_t pin = flash_word(&dir_pins.of[joint]);
    volatile uint8_t* const port = reinterpret_cast<volatile uint8_t*>(pin & 0xFF);
    const uint8_t mask = static_cast<uint8_t>(pin >> 8);
    const bool is_high = (port[2] & mask) != 0;
    if (is_high == high) return false;
    port[0] = mask;
    return true;
}

void drivers_enable(bool on) { write_pin(wire::ENABLE_PIN, on == enable_active_high); }

// The EEPROM may be busy for 3.4 ms: the pin first.
void set_enable_active_high(bool active_high) {
    enable_active_high = active_high;
    drivers_enable(false);
    keep_enable_polarity(active_high);
}

uint8_t inputs() {
    uint8_t bits = read_pin(wire::STOP_PIN) ? STOP_INPUT_OPEN : 0;
    for_each_joint([&](auto joint) {
        if (!read_pin(wire::LIMIT_PINS[joint.NUMBER])) bits |= static_cast<uint8_t>(1 << joint.NUMBER);
    });
    return bits;
}

void watch_stop_input(bool on) {
    static_assert(port_of(wire::STOP_PIN) == Port::C, "PCINT1 watches port C");
    PCMSK1 = on ? mask_of(wire::STOP_PIN) : 0;
    PCIFR = _BV(PCIF1);
    PCICR = on ? _BV(PCIE1) : 0;
}

}  // namespace hal
