// The queued segments, as they came: a ring of SEGMENTS payloads, each after a byte with its length.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "reader.h"

namespace planarm {
namespace queue {

void clear();

// True when nothing is left to be read.
bool is_empty();

// Bytes of the longest payload that fits now.
uint16_t free_bytes();

// Appends a payload that fits.
void append(const uint8_t* payload, uint8_t length);

// Reads the oldest payload, from its first byte; what is read must be given back by `release`.
void read_front(Reader& reader);
// Frees the oldest payload's bytes; its Reader is no longer good.
void release();

}  // namespace queue
}  // namespace planarm
