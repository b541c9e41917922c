#include "fixed.h"

namespace planarm {

void increase(uint32_t& value, uint32_t by) { value += by; }

uint32_t least_of(uint32_t a, uint32_t b) { return a < b ? a : b; }

uint32_t most_of(uint32_t a, uint32_t b) { return a < b ? b : a; }

}  // namespace planarm
