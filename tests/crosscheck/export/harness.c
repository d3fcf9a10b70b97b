/* Runs the exported law over the test vectors: `lookup` or `steps` on the
 * command line, lines of comma-separated numbers on standard input, answers on
 * standard output. Reads only the columns that the law needs. */
#include "law_law.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COLUMNS 19

static int numbers(char *line, double x[COLUMNS])
{
    int n = 0;
    for (char *at = strtok(line, ",\n"); at != NULL && n < COLUMNS; at = strtok(NULL, ",\n")) {
        x[n++] = strtod(at, NULL);
    }
    return n;
}

int main(int argc, char **argv)
{
    static char line[65536];
    double x[COLUMNS];
    law_state state;
    law_reset(&state);
    if (argc < 2 || fgets(line, sizeof line, stdin) == NULL) {
        return 2;
    }
    while (fgets(line, sizeof line, stdin) != NULL) {
        int n = numbers(line, x);
        if (strcmp(argv[1], "lookup") == 0) {
            law_real values[LAW_VALUES];
            law_at((law_real)x[0], values);
            for (unsigned int k = 0; k < LAW_VALUES; k++) {
                printf("%.17g,", (double)values[k]);
            }
            printf("%.17g\n", (double)law_turn_blend((law_real)x[0]));
            continue;
        }
        if (n != COLUMNS) {
            return 3;
        }
        const law_measurement m = { { (law_real)x[1], (law_real)x[2], (law_real)x[3] },
            { (law_real)x[4], (law_real)x[5], (law_real)x[6] }, (law_real)x[7], (law_real)x[8],
            (law_real)x[9] };
        const law_demand d = { x[10] > 0.5 ? LAW_VELOCITY : LAW_ATTITUDE,
            { (law_real)x[11], (law_real)x[12] }, (law_real)x[13], (law_real)x[14] };
        law_real sticks[4];
        if (strcmp(argv[1], "engage") == 0) {
            /* Switched on at what is flown, the law starts with these sticks. */
            const law_real given[4] = { 5, 4, 45, 3 };
            law_demand stay = d;
            stay.mode = LAW_ATTITUDE;
            stay.horizontal[0] = m.roll;
            stay.horizontal[1] = m.pitch;
            stay.heading_rate = 0;
            stay.vertical_velocity = 0;
            if (law_engage(&state, &m, &stay, given) != LAW_OK
                || law_step(&state, &m, &stay, sticks) != LAW_OK) {
                return 6;
            }
            for (unsigned int j = 0; j < 4; j++) {
                printf("%.17g%s", (double)(sticks[j] - given[j]), j < 3 ? "," : "\n");
            }
            continue;
        }
        if (law_step(&state, &m, &d, sticks) != LAW_OK) {
            return 4;
        }
        printf("%.17g,%.17g,%.17g,%.17g\n", (double)sticks[0], (double)sticks[1],
            (double)sticks[2], (double)sticks[3]);
        /* What is not finite is refused and leaves the law as it is. */
        law_measurement bad = m;
        bad.rates[1] = (law_real)strtod("nan", NULL);
        law_real held[4];
        if (law_step(&state, &bad, &d, held) != LAW_BAD_INPUT
            || memcmp(held, sticks, sizeof held) != 0) {
            return 5;
        }
    }
    return 0;
}
