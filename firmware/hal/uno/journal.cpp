#include "journal.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/crc16.h>

#include "hal_base.h"
#include "hal_journal.h"
#include "hal_step_timer.h"
#include "polarity.h"

namespace hal {

namespace {

constexpr uint8_t RECORDS = 128;
constexpr uint8_t CHECK_START = 0xA6;  // neither an erased nor a cleared EEPROM passes the check

struct Record {
    __uint24 mark;  // its number, modulo 2^23, and in the lowest bit whether the drivers are enabled
    uint8_t check;
};

struct Newest {
    Record record;
    uint8_t slot;
    uint8_t unwritten;  // bytes
};

Newest newest;

uint8_t* bytes_of(Record& of) { return reinterpret_cast<uint8_t*>(&of); }

bool is_ready() { return (EECR & _BV(EEPE)) == 0; }

[[gnu::noinline]] uint8_t read_byte(uint16_t address) {
    while (!is_ready()) {
    }
    EEAR = address;
    EECR |= _BV(EERE);
    return EEDR;
}

// The EEPROM must be ready.
void write_byte(uint16_t address, uint8_t value) {
    EEAR = address;
    EEDR = value;
    const InterruptLock lock;  // EEPE has to follow EEMPE within four cycles (ATmega328P datasheet, 7.6.3)
    EECR |= _BV(EEMPE);
    EECR |= _BV(EEPE);
}

[[gnu::noinline]] uint8_t check_of(Record& of) {
    uint8_t check = CHECK_START;
    for (uint8_t i = 0; i < sizeof(of.mark); ++i) check = _crc8_ccitt_update(check, bytes_of(of)[i]);
    return check;
}

// The newest is the one that the others are behind of, modulo 2^24.
void find_newest(Newest& at) {
    bool found = false;
    uint16_t address = 0;
    for (uint8_t index = 0; index < RECORDS; ++index) {
        Record read;
        for (uint8_t i = 0; i < sizeof(read); ++i) bytes_of(read)[i] = read_byte(address++);
        if (read.check != check_of(read)) continue;
        if (found && static_cast<__int24>(read.mark - at.record.mark) <= 0) continue;
        found = true;
        at.record = read;
        at.slot = index;
    }
}

// A record that is still being written is left as it is: a mark never waits for another, and however fast
// they come, a cell is written once in a round.
void begin_record(bool enabled) {
    Newest& at = by_base(newest);
    at.record.mark += 2;
    at.slot = static_cast<uint8_t>((at.slot + 1) % RECORDS);
    at.record.mark &= ~static_cast<__uint24>(1);
    if (enabled) at.record.mark |= 1;
    at.record.check = check_of(at.record);
    at.unwritten = sizeof(at.record);
}

}  // namespace

JournalBoot journal_boot() {
    Newest& at = by_base(newest);
    find_newest(at);
    const bool was_enabled = (at.record.mark & 1) != 0;
    begin_record(false);
    while (at.unwritten != 0) journal_serve();
    while (!is_ready()) {
    }
    return {at.record.mark, was_enabled};
}

void journal_mark(bool enabled) { begin_record(enabled); }

void journal_serve() {
    Newest& at = by_base(newest);
    if (at.unwritten == 0 || !is_ready()) return;
    --at.unwritten;
    write_byte(static_cast<uint16_t>(at.slot * sizeof(at.record) + at.unwritten),
               bytes_of(at.record)[at.unwritten]);
}

void keep_enable_polarity(bool active_high) {
    const uint8_t wanted = active_high ? ACTIVE_HIGH : 0xFF;
    if (read_byte(POLARITY_ADDRESS) == wanted) return;
    write_byte(POLARITY_ADDRESS, wanted);
}

}  // namespace hal
