// State: that is reached from a base register, and that begins as zero.
#pragma once

namespace hal {

// The same object, by an address that the compiler must take from a register. A byte at a known address takes
// four bytes of code to load or store, one near a base register two.
template <typename State>
inline __attribute__((always_inline)) State& by_base(State& state) {
    State* base = &state;
    __asm__("" : "+b"(base));
    return *base;
}

// Clears state for start-up: here all memory is clear before main.
template <typename State>
inline void clear_at_start(State&) {}

}  // namespace hal
