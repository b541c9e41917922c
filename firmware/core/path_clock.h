// How path time becomes ticks. The path clock runs at a rate u = 1 / s; the stretch s is 1 (as planned) or
// more. It changes linearly in path time inside a slice of the path and is continuous across slices:
//
//     t(p) = s0 p + (s1 - s0) p^2 / (2 D)        p = 0 .. D path ticks
//
// With u' = -(s1 - s0) / (D s^3), a slowing of at most L a tick asks for s1 <= s0 + L D s0^3, a speeding up
// of at most F for s0 <= s1 + F D s1^3. At s = 1 ticks are path ticks, exactly.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace path_clock {

constexpr uint32_t ONE = 0x10000;  // a stretch of 1
constexpr uint32_t MAX_STRETCH = static_cast<uint32_t>(wire::MAX_STRETCH) << 16;
static_assert(wire::SLICE_TICKS <= 0x10000, "path times in a slice have 16 bits");

// The value of a rate code, in 2^-32 a tick.
uint32_t rate_value(uint8_t code);

// A change of the stretch over a slice: from, to at best, by what rate, over how much path.
struct Change {
    uint32_t stretch;
    uint32_t target;
    uint32_t rate;  // in 2^-32 a tick
    uint32_t path_ticks;
};

// The stretch at the end of the slice, as near to the target as the rate allows.
uint32_t stretch_after(const Change& change);

// Path that the clock is to go.
struct Stretch {
    uint32_t from_path;  // in its segment
    uint32_t path_ticks;
    uint32_t start_ticks;
    uint32_t s0;
    uint32_t s1;
    bool ends_segment;
};

// A stretch of the path in which the rate changes evenly.
class Slice {
  public:
    void begin(const Stretch& path);

    bool is_plain() const { return plain_; }
    bool ends_segment() const { return path_.ends_segment; }
    uint32_t ticks() const { return ticks_; }
    uint32_t end_path() const { return path_.from_path + path_.path_ticks; }
    uint32_t least_stretch() const { return path_.s0 < path_.s1 ? path_.s0 : path_.s1; }

    // Path time since the slice's start of a path time of the segment, before the slice's end.
    uint16_t path_of(uint32_t path) const { return static_cast<uint16_t>(path - path_.from_path); }
    // The tick of such a path time, and the stretch there.
    uint32_t ticks_at(uint16_t path) const;
    uint32_t stretch_at(uint16_t path) const;

    // The clock stood still.
    void shift(uint32_t ticks) { path_.start_ticks += ticks; }

  private:
    Stretch path_;
    uint32_t ticks_;
    uint32_t reciprocal_;  // 2^32 / path_ticks
    bool plain_;           // at a stretch of 1
};

}  // namespace path_clock
}  // namespace planarm
