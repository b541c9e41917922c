// Pins by their numbers on the board: D0 to D13, A0 to A5 as 14 to 19. Each call is one instruction or two.
#pragma once

#include <avr/io.h>
#include <stdint.h>

namespace hal {

enum class Port : uint8_t { B = 0x05, C = 0x08, D = 0x0B };  // addresses of PORTx for SBI and CBI

constexpr Port port_of(uint8_t pin) { return pin < 8 ? Port::D : pin < 14 ? Port::B : Port::C; }
constexpr uint8_t bit_of(uint8_t pin) {
    return static_cast<uint8_t>(pin < 8 ? pin : pin < 14 ? pin - 8 : pin - 14);
}
constexpr uint8_t mask_of(uint8_t pin) { return static_cast<uint8_t>(1 << bit_of(pin)); }

// The bits of those of the pins that a port has.
template <uint8_t COUNT>
constexpr uint8_t mask_in(Port port, const uint8_t (&pins)[COUNT], uint8_t from = 0) {
    return static_cast<uint8_t>(from == COUNT ? 0
                                              : (port_of(pins[from]) == port ? mask_of(pins[from]) : 0) |
                                                    mask_in(port, pins, static_cast<uint8_t>(from + 1)));
}

inline __attribute__((always_inline)) void write_pin(uint8_t pin, bool high) {
    const uint8_t mask = mask_of(pin);
    volatile uint8_t& port = port_of(pin) == Port::D ? PORTD : port_of(pin) == Port::B ? PORTB : PORTC;
    if (high) {
        port |= mask;
    } else {
        port &= static_cast<uint8_t>(~mask);
    }
}

// The level of an output, as it was written.
inline __attribute__((always_inline)) bool written_pin(uint8_t pin) {
    const uint8_t port = port_of(pin) == Port::D ? PORTD : port_of(pin) == Port::B ? PORTB : PORTC;
    return (port & mask_of(pin)) != 0;
}

inline __attribute__((always_inline)) bool read_pin(uint8_t pin) {
    const uint8_t levels = port_of(pin) == Port::D ? PIND : port_of(pin) == Port::B ? PINB : PINC;
    return (levels & mask_of(pin)) != 0;
}

}  // namespace hal
