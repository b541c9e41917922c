#include "frame_receiver.h"

#include "framing.h"
#include "hal_crc.h"

namespace planarm {

void FrameReceiver::reset() {
    count_ = 0;
    end_ = PAYLOAD_AT;
    crc_ = wire::CRC_INITIAL;
    escaped_ = false;
    damaged_ = false;
}

FrameReceiver::Received FrameReceiver::receive(const uint8_t* bytes, uint8_t count) {
    Event event = Event::NONE;
    uint8_t used = 0;
    do {
        const uint8_t byte = bytes[used];
        if (is_special(byte)) {
            ++used;
            event = special(byte);
        } else {
            used = static_cast<uint8_t>(used + append(bytes + used, static_cast<uint8_t>(count - used)));
        }
    } while (used != count && event == Event::NONE);
    return {used, event};
}

// Keeps bytes until one is special or the frame is as long as known, or one that is escaped; returns
// how many. Those of a damaged frame go nowhere.
uint8_t FrameReceiver::append(const uint8_t* bytes, uint8_t count) {
    uint8_t flipped = 0;
    if (escaped_) {
        escaped_ = false;
        flipped = wire::ESCAPE_XOR;
        count = 1;
        damaged_ = damaged_ || !is_special(*bytes ^ flipped);
    }
    damaged_ = damaged_ || count_ == end_;  // longer than its header says
    if (damaged_) return 1;
    uint8_t room = static_cast<uint8_t>((count_ < PAYLOAD_AT ? PAYLOAD_AT : end_) - count_);
    if (room > count) room = count;
    uint8_t* at = reinterpret_cast<uint8_t*>(&frame_) + count_;
    uint8_t left = room;
    uint16_t crc = crc_;
    do {
        const uint8_t byte = *bytes++ ^ flipped;
        *at++ = byte;
        crc = hal::crc_update(crc, byte);
    } while (--left != 0 && !is_special(*bytes));
    crc_ = crc;
    count_ = static_cast<uint8_t>(count_ + room - left);
    if (count_ == PAYLOAD_AT) look_at_header();
    return static_cast<uint8_t>(room - left);
}

// A message followed by its own checksum leaves 0. The payload's checksum goes on from the header's.
void FrameReceiver::look_at_header() {
    const uint8_t length = frame_.length;
    damaged_ = crc_ != 0 || length > wire::MAX_PAYLOAD_BYTES;
    if (damaged_ || length == 0) return;
    crc_ = static_cast<uint16_t>(frame_.header_crc[0] | (frame_.header_crc[1] << 8));
    end_ = static_cast<uint8_t>(PAYLOAD_AT + length + wire::CRC_BYTES);
}

FrameReceiver::Event FrameReceiver::special(uint8_t byte) {
    if (byte == wire::DELIMITER) return finish();
    if (is_reserved(byte)) return Event::NONE;
    damaged_ = damaged_ || escaped_;
    escaped_ = true;
    return Event::NONE;
}

FrameReceiver::Event FrameReceiver::finish() {
    const bool silence = count_ == 0 && !escaped_ && !damaged_;
    const bool good = count_ == end_ && crc_ == 0 && !escaped_ && !damaged_;
    reset();
    if (silence) return Event::NONE;
    return good ? Event::FRAME : Event::DAMAGED;
}

}  // namespace planarm
