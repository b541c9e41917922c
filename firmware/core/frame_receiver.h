// Turns the byte stream into checked frames: unstuffing, both checksums, resynchronisation at every
// delimiter.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {

// A checked frame; `payload` stays valid until the next byte is received.
struct Frame {
    uint8_t length;
    uint8_t seq;
    uint8_t type;
    const uint8_t* payload;
};

class FrameReceiver {
  public:
    enum class Event : uint8_t { NONE, FRAME, DAMAGED };

    // Takes one byte of the line. DAMAGED is told once for each delimiter that ends something other than a
    // good frame.
    Event receive(uint8_t byte);

    // The frame of the last FRAME event.
    Frame frame() const { return {buffer_[0], buffer_[1], buffer_[2], buffer_ + PAYLOAD_AT}; }

  private:
    static constexpr uint8_t PAYLOAD_AT = wire::HEADER_BYTES + wire::CRC_BYTES;

    void append(uint8_t byte);
    Event finish();

    uint8_t buffer_[PAYLOAD_AT + wire::MAX_PAYLOAD_BYTES + wire::CRC_BYTES];
    uint8_t count_ = 0;
    uint8_t end_ = PAYLOAD_AT;  // bytes that the frame has when complete, as far as known
    uint16_t crc_ = wire::CRC_INITIAL;
    bool escaped_ = false;
    bool damaged_ = false;
};

}  // namespace planarm
