/*
 * Control law: see @P@_law.h for what it is, its units and its rules.
@WARNINGS@ */
#include "@P@_law.h"

#include <math.h>
#include <stddef.h>

typedef @P@_real real;

@CONSTANTS@
/* Lower and upper limits of lat, lon, col, ped, percent. */
static const real LIMITS[4][2] = {
@LIMITS@};

/* True airspeed of the breakpoints, m/s. */
static const real SPEEDS[@U@_BREAKPOINTS] = {
@SPEEDS@};

static const real TABLE[@U@_BREAKPOINTS][@U@_VALUES] = {
@TABLE@};

static real held(real x, real low, real high)
{
    return (x < low) ? low : ((x > high) ? high : x);
}

static unsigned int all_finite(const real *x, unsigned int count)
{
    unsigned int finite = 1u;
    for (unsigned int j = 0u; j < count; j++) {
        if (!isfinite(x[j])) {
            finite = 0u;
        }
    }
    return finite;
}

void @P@_at(@P@_real airspeed, @P@_real values[@U@_VALUES])
{
    /* Breakpoints at or below the speed. */
    unsigned int k = 0u;
    while ((k < @U@_BREAKPOINTS) && (SPEEDS[k] <= airspeed)) {
        k++;
    }
    const unsigned int low = (k == 0u) ? 0u : (k - 1u);
    const unsigned int high = (k == @U@_BREAKPOINTS) ? low : k;
    const real gap = SPEEDS[high] - SPEEDS[low];
    const real t = (gap > @ZERO@) ? ((airspeed - SPEEDS[low]) / gap) : @ZERO@;
    const real s = @ONE@ - t;
    for (unsigned int i = 0u; i < @U@_VALUES; i++) {
        values[i] = (s * TABLE[low][i]) + (t * TABLE[high][i]);
    }
}

@P@_real @P@_turn_blend(@P@_real airspeed)
{
@TURN_BLEND@    return turn_blend;
}

void @P@_reset(@P@_state *state)
{
@RESET@    for (unsigned int k = 0u; k < @U@_LINE; k++) {
@RESET_LINES@    }
    state->oldest = 0u;
    for (unsigned int i = 0u; i < 4u; i++) {
        state->sticks[i] = held(TABLE[0][@U@_TRIM_STICKS + i], LIMITS[i][0], LIMITS[i][1]);
    }
}

/* Fills a delay line. */
static void fill(real line[@U@_LINE], real value)
{
    for (unsigned int k = 0u; k < @U@_LINE; k++) {
        line[k] = value;
    }
}

/* Solves a x = b, of four unknowns, by elimination with row exchanges; what is
 * given is used up. Returns whether a is regular. */
static unsigned int solve(real a[4][4], real b[4])
{
    unsigned int regular = 1u;
    for (unsigned int k = 0u; (k < 4u) && (regular != 0u); k++) {
        unsigned int pivot = k;
        for (unsigned int i = k + 1u; i < 4u; i++) {
            if ((a[i][k] * a[i][k]) > (a[pivot][k] * a[pivot][k])) {
                pivot = i;
            }
        }
        for (unsigned int j = 0u; j < 4u; j++) {
            const real kept = a[k][j];
            a[k][j] = a[pivot][j];
            a[pivot][j] = kept;
        }
        const real kept = b[k];
        b[k] = b[pivot];
        b[pivot] = kept;
        if ((a[k][k] * a[k][k]) > @ZERO@) {
            for (unsigned int i = k + 1u; i < 4u; i++) {
                const real factor = a[i][k] / a[k][k];
                for (unsigned int j = k; j < 4u; j++) {
                    a[i][j] -= factor * a[k][j];
                }
                b[i] -= factor * b[k];
            }
        } else {
            regular = 0u;
        }
    }
    for (unsigned int n = 4u; (n > 0u) && (regular != 0u); n--) {
        const unsigned int i = n - 1u;
        for (unsigned int j = n; j < 4u; j++) {
            b[i] -= a[i][j] * b[j];
        }
        b[i] /= a[i][i];
    }
    return regular;
}

/* The law, block by block. Given sticks, it is engaged with them: memories hold
 * what they start with, and integrals take what the law lacks. */
static void run(@P@_state *state, const @P@_measurement *m, const @P@_demand *demand,
    const real *given)
{
    real table[@U@_VALUES];
@BLOCKS@
    if (engaging != 0u) {
@ENGAGING@
@HOLD@    } else {
@STORE@    }
@STICKS@}

static unsigned int usable(const @P@_measurement *m, const @P@_demand *demand)
{
    const real other[7] = { m->roll, m->pitch, m->airspeed, demand->horizontal[0],
        demand->horizontal[1], demand->heading_rate, demand->vertical_velocity };
    return ((all_finite(m->velocity_body, 3u) != 0u) && (all_finite(m->rates, 3u) != 0u)
               && (all_finite(other, 7u) != 0u))
        ? 1u
        : 0u;
}

@P@_status @P@_engage(@P@_state *state, const @P@_measurement *measurement,
    const @P@_demand *demand, const @P@_real sticks[4])
{
    @P@_status status = @U@_BAD_INPUT;
    if ((usable(measurement, demand) != 0u) && (all_finite(sticks, 4u) != 0u)) {
        @P@_reset(state);
        run(state, measurement, demand, sticks);
        for (unsigned int i = 0u; i < 4u; i++) {
            state->sticks[i] = held(sticks[i], LIMITS[i][0], LIMITS[i][1]);
        }
        status = @U@_OK;
    }
    return status;
}

@P@_status @P@_step(@P@_state *state, const @P@_measurement *measurement,
    const @P@_demand *demand, @P@_real sticks[4])
{
    @P@_status status = @U@_BAD_INPUT;
    if (usable(measurement, demand) != 0u) {
        run(state, measurement, demand, NULL);
        status = @U@_OK;
    }
    for (unsigned int j = 0u; j < 4u; j++) {
        sticks[j] = state->sticks[j];
    }
    return status;
}
