#include "fixed.h"

namespace planarm {

void increase(uint32_t& value, uint32_t by) { value += by; }

}  // namespace planarm
