// The host's commands, all but HELLO and SEGMENTS: checks their fields, asks the supervisor, carries them
// out.
#pragma once

#include "frame_receiver.h"

namespace planarm {
namespace commands {

wire::Result execute(const Frame& frame);

}  // namespace commands
}  // namespace planarm
