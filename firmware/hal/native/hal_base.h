// State: that is reached from a base register, which only the AVR needs to be told, and that begins as zero.
#pragma once

namespace hal {

template <typename State>
inline State& by_base(State& state) {
    return state;
}

// Clears state for start-up: a PC starts the firmware anew many times.
template <typename State>
inline void clear_at_start(State& state) {
    state = State();
}

}  // namespace hal
