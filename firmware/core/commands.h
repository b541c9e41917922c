// The host's commands, all but HELLO and SEGMENTS: reads their fields, asks the supervisor, carries them out.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "reader.h"

namespace planarm {
namespace commands {

wire::Result execute(wire::MessageType type, Reader& fields, uint32_t now_ticks);

}  // namespace commands
}  // namespace planarm
