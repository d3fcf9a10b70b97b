/* Answers lines of numbers on standard input with the sticks of the exported
 * law: engage (0 or 1), u v w p q r phi theta airspeed, mode, two commands,
 * heading rate, vertical velocity, and the sticks to engage with. */
#include "law_law.h"

#include <stdio.h>

int main(void)
{
    law_state state;
    double x[19];
    law_reset(&state);
    for (;;) {
        for (int k = 0; k < 19; k++) {
            if (scanf("%lf", &x[k]) != 1) {
                return k == 0 ? 0 : 1;
            }
        }
        const law_measurement m = { { x[1], x[2], x[3] }, { x[4], x[5], x[6] }, x[7], x[8], x[9] };
        const law_demand d
            = { x[10] > 0.5 ? LAW_VELOCITY : LAW_ATTITUDE, { x[11], x[12] }, x[13], x[14] };
        law_real sticks[4] = { x[15], x[16], x[17], x[18] };
        const law_status status = (x[0] > 0.5) ? law_engage(&state, &m, &d, sticks)
                                               : law_step(&state, &m, &d, sticks);
        if (status != LAW_OK) {
            return 2;
        }
        printf("%.17g %.17g %.17g %.17g\n", sticks[0], sticks[1], sticks[2], sticks[3]);
        fflush(stdout);
    }
}
