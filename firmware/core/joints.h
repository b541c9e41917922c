// Joints whose numbers the compiler knows, so that each one's pins and timers are instructions, not tables.
#pragma once

#include <stdint.h>

#include "wiring.h"

namespace planarm {

template <uint8_t JOINT>
struct JointNumber {
    static constexpr uint8_t NUMBER = JOINT;
};

template <uint8_t JOINT>
struct JointLoop {
    template <typename Action>
    static inline __attribute__((always_inline)) void run(Action& action) {
        action(JointNumber<JOINT>());
        JointLoop<JOINT + 1>::run(action);
    }
};

template <>
struct JointLoop<wire::JOINTS> {
    template <typename Action>
    static inline void run(Action&) {}
};

// Calls `action` with each joint's JointNumber.
template <typename Action>
inline __attribute__((always_inline)) void for_each_joint(Action action) {
    JointLoop<0>::run(action);
}

}  // namespace planarm
