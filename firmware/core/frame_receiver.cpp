#include "frame_receiver.h"

#include "framing.h"
#include "hal_crc.h"

namespace planarm {

FrameReceiver::Event FrameReceiver::receive(uint8_t byte) {
    if (is_special(byte)) {
        if (byte == wire::DELIMITER) return finish();
        if (is_reserved(byte)) return Event::NONE;
        damaged_ = damaged_ || escaped_;
        escaped_ = true;
        return Event::NONE;
    }
    if (escaped_) {
        escaped_ = false;
        byte ^= wire::ESCAPE_XOR;
        damaged_ = damaged_ || !is_special(byte);
    }
    append(byte);
    return Event::NONE;
}

void FrameReceiver::append(uint8_t byte) {
    if (damaged_) return;
    if (count_ == end_) {  // longer than its header says
        damaged_ = true;
        return;
    }
    reinterpret_cast<uint8_t*>(&frame_)[count_++] = byte;
    crc_ = hal::crc_update(crc_, byte);
    if (count_ != PAYLOAD_AT) return;

    // A message followed by its own checksum leaves 0. The payload's checksum goes on from the header's.
    const uint8_t length = frame_.length;
    damaged_ = crc_ != 0 || length > wire::MAX_PAYLOAD_BYTES;
    if (damaged_ || length == 0) return;
    crc_ = static_cast<uint16_t>(frame_.header_crc[0] | (frame_.header_crc[1] << 8));
    end_ = static_cast<uint8_t>(PAYLOAD_AT + length + wire::CRC_BYTES);
}

FrameReceiver::Event FrameReceiver::finish() {
    const bool silence = count_ == 0 && !escaped_ && !damaged_;
    const bool good = count_ == end_ && crc_ == 0 && !escaped_ && !damaged_;
    count_ = 0;
    end_ = PAYLOAD_AT;
    crc_ = wire::CRC_INITIAL;
    escaped_ = false;
    damaged_ = false;
    if (silence) return Event::NONE;
    return good ? Event::FRAME : Event::DAMAGED;
}

}  // namespace planarm
