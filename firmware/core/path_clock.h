// How path time becomes ticks. The path clock runs at a rate u = 1 / s; the stretch s is 1 (as planned) or
// more. It changes linearly in path time inside a slice of the path and is continuous across slices:
//
//     t(p) = s0 p + (s1 - s0) p^2 / (2 D)        p = 0 .. D path ticks
//
// With u' = -(s1 - s0) / (D s^3), a slowing of at most L a tick asks for s1 <= s0 + L D s0^3, a speeding up
// of at most F for s0 <= s1 + F D s1^3. At s = 1 ticks are path ticks, exactly.
#pragma once

#include <stdint.h>

#include "fixed.h"
#include "messages.h"

namespace planarm {
namespace path_clock {

constexpr uint32_t ONE = 0x10000;  // a stretch of 1
constexpr uint32_t MAX_STRETCH = static_cast<uint32_t>(wire::MAX_STRETCH) << 16;
static_assert(wire::SLICE_TICKS <= 0xFFFF, "path times in a slice have 16 bits");

// The value of a rate code, in 2^-32 a tick.
uint32_t rate_value(uint8_t code);

// Codes of the rates by which the clock may change.
struct Rates {
    uint8_t slow;  // slowing down
    uint8_t fast;  // speeding up
};

// What is asked of a slice: its length, the stretch that is wished for its end, and the rates.
struct Way {
    uint16_t path_ticks;
    bool ends_segment;
    bool gently;  // by GENTLE_PERCENT of the rates
    uint32_t target;
    Rates rates;
};

// The stretch at the way's end, as near to its target as its rate allows.
uint32_t stretch_after(uint32_t stretch, const Way& way);

// A stretch of the path in which the rate changes evenly; each goes on from the end of the one before.
class Slice {
  public:
    // The next slice begins at this tick, with this stretch.
    void begin_at(uint32_t ticks) { end_ticks_ = ticks; }
    void begin_with(uint32_t stretch) { s1_ = stretch; }

    // The next slice: what is asked of it, to be written before, and to go on from there.
    Way& way() { return way_; }
    void follow();

    bool is_plain() const { return plain_; }  // at a stretch of 1
    bool ends_segment() const { return way_.ends_segment; }
    uint16_t path_ticks() const { return way_.path_ticks; }
    uint32_t start_ticks() const { return start_ticks_; }
    uint32_t end_ticks() const { return end_ticks_; }
    uint32_t end_stretch() const { return s1_; }
    uint32_t least_stretch() const { return least_of(s0_, s1_); }

    // The stretch at a path time since the slice's start, and its tick; a plain slice needs no stretch for
    // it.
    uint32_t stretch_at(uint16_t path) const;
    uint32_t ticks_at(uint16_t path, uint32_t stretch) const;

  private:
    uint32_t start_ticks_;
    uint32_t end_ticks_;
    uint32_t s0_;
    uint32_t s1_;
    uint32_t range_;       // from the lesser stretch to the greater one
    uint32_t reciprocal_;  // 2^32 / divided_ticks_, the path ticks of the last slice that needed it
    uint16_t divided_ticks_;
    Way way_;
    bool plain_;
    bool falls_;  // the stretch does
};

}  // namespace path_clock
}  // namespace planarm
