// A test harness of thirty lines: CASE defines a test, CHECK counts what does not hold, run_all tells both.
#pragma once

#include <stdio.h>

struct Case {
    const char* name;
    void (*body)();
    Case* next = nullptr;

    Case(const char* name, void (*body)()) : name(name), body(body) {
        Case** last = &first();
        while (*last != nullptr) last = &(*last)->next;
        *last = this;
    }

    static Case*& first() {
        static Case* head = nullptr;
        return head;
    }
    static int& failures() {
        static int count = 0;
        return count;
    }
};

#define CASE(name)                        \
    static void name();                   \
    static Case case_##name(#name, name); \
    static void name()

#define CHECK(condition)                                                   \
    do {                                                                   \
        if (!(condition)) {                                                \
            printf("%s:%d: not so: %s\n", __FILE__, __LINE__, #condition); \
            ++Case::failures();                                            \
        }                                                                  \
    } while (false)

inline int run_all() {
    int failed = 0;
    for (const Case* test = Case::first(); test != nullptr; test = test->next) {
        Case::failures() = 0;
        test->body();
        printf("%s %s\n", Case::failures() == 0 ? "PASS" : "FAIL", test->name);
        failed += Case::failures() == 0 ? 0 : 1;
    }
    return failed == 0 ? 0 : 1;
}
