/* Differences of the exported law: reads lines of
 *
 *     memories lines steps size, u v w p q r phi theta airspeed, mode, two commands,
 *     heading rate, vertical velocity
 *
 * makes that many steps at these inputs, and then writes, one line each, the
 * change of (memories, what entered each delay line, sticks) per change of each
 * memory, each measurement, each demand, and what each delay line gives, by
 * central differences of that size. It looks into the state: numbers by the
 * order of its members. */
#include "law_law.h"

#include <stdio.h>
#include <string.h>

#define MOST 256

static int memories, lines;

/* A step from a state with one number changed. */
static void answer(const law_state *from, const double input[14], int seed, double by,
    double out[MOST])
{
    law_state state;
    double x[14];
    double *number = (double *)&state;
    memcpy(&state, from, sizeof state);
    memcpy(x, input, sizeof x);
    const unsigned int oldest = state.oldest;
    if (seed < memories) {
        number[seed] += by;
    } else if (seed < memories + 13) {
        /* The mode is no number that changes. */
        const int k = seed - memories;
        x[k < 9 ? k : k + 1] += by;
    } else {
        number[memories + (seed - memories - 13) * (int)LAW_LINE + (int)oldest] += by;
    }
    const law_measurement m = { { x[0], x[1], x[2] }, { x[3], x[4], x[5] }, x[6], x[7], x[8] };
    const law_demand d = { x[9] > 0.5 ? LAW_VELOCITY : LAW_ATTITUDE, { x[10], x[11] }, x[12], x[13] };
    law_real sticks[4];
    (void)law_step(&state, &m, &d, sticks);
    int n = 0;
    for (int k = 0; k < memories; k++) {
        out[n++] = number[k];
    }
    for (int k = 0; k < lines; k++) {
        out[n++] = number[memories + k * (int)LAW_LINE + (int)oldest];
    }
    for (int k = 0; k < 4; k++) {
        out[n++] = sticks[k];
    }
}

int main(void)
{
    double steps, size, input[14], up[MOST], down[MOST];
    while (scanf("%d %d %lf %lf", &memories, &lines, &steps, &size) == 4) {
        for (int k = 0; k < 14; k++) {
            if (scanf("%lf", &input[k]) != 1) {
                return 1;
            }
        }
        law_state state;
        law_reset(&state);
        for (int k = 0; k < (int)steps; k++) {
            const double *x = input;
            const law_measurement m
                = { { x[0], x[1], x[2] }, { x[3], x[4], x[5] }, x[6], x[7], x[8] };
            const law_demand d = { x[9] > 0.5 ? LAW_VELOCITY : LAW_ATTITUDE, { x[10], x[11] },
                x[12], x[13] };
            law_real sticks[4];
            if (law_step(&state, &m, &d, sticks) != LAW_OK) {
                return 2;
            }
        }
        const int seeds = memories + 13 + lines;
        for (int seed = 0; seed < seeds; seed++) {
            answer(&state, input, seed, size, up);
            answer(&state, input, seed, -size, down);
            for (int k = 0; k < memories + lines + 4; k++) {
                printf("%.17g ", (up[k] - down[k]) / (2.0 * size));
            }
            printf("\n");
        }
    }
    return 0;
}
