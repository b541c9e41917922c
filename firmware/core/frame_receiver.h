// Turns the byte stream into checked frames: unstuffing, both checksums, resynchronisation at every
// delimiter.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {

// A frame as it is on the line, unstuffed.
struct Frame {
    uint8_t length;
    uint8_t seq;
    uint8_t type;
    uint8_t header_crc[wire::CRC_BYTES];
    uint8_t payload[wire::MAX_PAYLOAD_BYTES + wire::CRC_BYTES];  // and its checksum

    // The payload as a message of messages.h, which must be as long.
    template <typename Message>
    const Message& as() const {
        return *reinterpret_cast<const Message*>(payload);
    }
};

class FrameReceiver {
  public:
    enum class Event : uint8_t { NONE, FRAME, DAMAGED };

    // Before the first byte.
    void reset();

    struct Received {
        uint8_t bytes;
        Event event;
    };

    // Takes bytes of the line, at least one, as far as the first event. DAMAGED is told
    // once for each delimiter that ends something other than a good frame. On the Uno 58 cycles a byte.
    Received receive(const uint8_t* bytes, uint8_t count);

    // The frame of the last FRAME event; it stays until the next byte is received.
    const Frame& frame() const { return frame_; }

  private:
    static constexpr uint8_t PAYLOAD_AT = wire::HEADER_BYTES + wire::CRC_BYTES;

    uint8_t append(const uint8_t* bytes, uint8_t count);
    void look_at_header();
    Event special(uint8_t byte);
    Event finish();

    // The frame last: what comes behind it is too far from the object's address for the AVR's short
    // instructions.
    uint8_t count_;
    uint8_t end_;  // bytes that the frame has when complete, as far as known
    uint16_t crc_;
    bool escaped_;
    bool damaged_;
    Frame frame_;
};

}  // namespace planarm
