// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// A run of a library without an operating system, on the Cortex-M7 of QEMU. Its files are those of
// the host (semihosting): it reads reference.bin, and writes the signals of all ticks to signals.bin.
// It prints the instructions of a control tick: with `-icount shift=0` each takes 1 ns.
#include "paper.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STACK_END 0x20400000u
#define COPROCESSORS (*(volatile uint32_t *)0xE000ED88)
#define SYSTICK ((volatile uint32_t *)0xE000E010)
#define PERIOD 40 /* ns of the clock of the board, 25 MHz */

extern void initialise_monitor_handles(void);
void reset(void);

// The C library calls these when the program ends.
void _init(void) {}
void _fini(void) {}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))STACK_END, reset};

static int run(void) {
    paper_settings settings = paper_settings_initial;
    paper_memory memory = paper_memory_initial;
    paper_signals signals = paper_signals_initial;
    paper_plant_settings robot = paper_plant_settings_initial;
    paper_plant_memory state = paper_plant_memory_initial;
    static double delay_line[PAPER_DELAY_LINE];
    double reference[PAPER_REFERENCE], position[PAPER_POSITION], velocity[PAPER_VELOCITY];
    uint32_t total = 0, largest = 0;
    FILE *path = fopen("reference.bin", "rb"), *out = fopen("signals.bin", "wb");
    if (!path || !out) {
        return 1;
    }
    paper_plant_start(&robot, &state, delay_line, &signals);
    for (int64_t tick = 0; tick < PAPER_TICKS; tick++) {
        if (fread(reference, sizeof reference, 1, path) != 1) {
            return 1;
        }
        memcpy(position, signals.position, sizeof position);
        memcpy(velocity, signals.velocity, sizeof velocity);
        uint32_t start = SYSTICK[2];
        paper_control_tick(&settings, &memory, &signals, position, velocity, reference);
        uint32_t spent = (start - SYSTICK[2]) & 0xFFFFFF;  // it counts down, in 24 bits
        total += spent;
        largest = spent > largest ? spent : largest;
        fwrite(&signals, sizeof signals, 1, out);
        if (tick < PAPER_TICKS - 1) {
            paper_plant_tick(&robot, &state, delay_line, tick, &signals);
        }
    }
    printf("%lu instructions in a control tick, at most %lu\n",
           (unsigned long)(PERIOD * (uint64_t)total / PAPER_TICKS),
           (unsigned long)(PERIOD * largest));
    return fclose(out) ? 1 : 0;
}

void reset(void) {
    COPROCESSORS |= 0xF << 20;  // the unit for floating-point numbers
    __asm volatile("dsb\nisb");
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    initialise_monitor_handles();
    exit(run());
}
