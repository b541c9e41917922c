// State that is reached from a base register, which only the AVR needs to be told.
#pragma once

namespace hal {

template <typename State>
inline State& by_base(State& state) {
    return state;
}

}  // namespace hal
