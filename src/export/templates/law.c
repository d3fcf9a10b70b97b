/*
 * Control law: see @P@_law.h for what it is, its units and its rules.
@WARNINGS@ */
#include "@P@_law.h"

#include <math.h>

typedef @P@_real real;

#define ROLL (0u)
#define PITCH (1u)
#define YAW (2u)
#define HEAVE (3u)
/* Horizontal velocities among the references: forward, then to the right. */
#define VELOCITY (4u)

/* Columns of gains, and rows of the outer loops. */
#define K_D (0u)
#define K_P (1u)
#define K_I (2u)
#define VX (4u)
#define VY (5u)

/* Parts of a reference. */
#define VALUE (0u)
#define RATE (1u)
#define ACCELERATION (2u)

static const real STEP = @STEP@;
@CONSTANTS@
/* Lower and upper limits of lat, lon, col, ped, percent. */
static const real LIMITS[4][2] = {
@LIMITS@};

/* The stick whose loop each axis closes. */
static const unsigned int EFFECTOR[4] = { @U@_LAT, @U@_LON, @U@_PED, @U@_COL };

/* True airspeed of the breakpoints, m/s. */
static const real SPEEDS[@U@_BREAKPOINTS] = {
@SPEEDS@};

static const real TABLE[@U@_BREAKPOINTS][@U@_VALUES] = {
@TABLE@};

static real held(real x, real low, real high)
{
    return (x < low) ? low : ((x > high) ? high : x);
}

/* Sum of count products. */
static real dot(const real *row, const real *x, unsigned int count)
{
    real sum = row[0] * x[0];
    for (unsigned int j = 1u; j < count; j++) {
        sum += row[j] * x[j];
    }
    return sum;
}

/* Adds to a sum that runs for minutes without leaving out what rounding takes
 * from each change (Kahan). */
static void add(real *sum, real *rest, real change)
{
    const real whole = change + *rest;
    const real before = *sum;
    *sum = before + whole;
    *rest = whole - (*sum - before);
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
    const real t = held(((airspeed - TURN_SPEED) / TURN_WIDTH) + @HALF@, @ZERO@, @ONE@);
    return t * t * (@THREE@ - (@TWO@ * t));
}

void @P@_reset(@P@_state *state)
{
    for (unsigned int i = 0u; i < 6u; i++) {
        for (unsigned int j = 0u; j < 3u; j++) {
            state->reference[i][j] = @ZERO@;
        }
        for (unsigned int k = 0u; k <= @U@_DELAY; k++) {
            state->history[k][i][VALUE] = @ZERO@;
            state->history[k][i][RATE] = @ZERO@;
        }
    }
    for (unsigned int i = 0u; i < 4u; i++) {
        state->integral[i] = @ZERO@;
        state->sticks[i] = held(TABLE[0][@U@_TRIM_STICKS + i], LIMITS[i][0], LIMITS[i][1]);
    }
    for (unsigned int i = 0u; i < 2u; i++) {
        state->velocity_integral[i] = @ZERO@;
        state->velocity_command[i] = @ZERO@;
        state->velocity_rest[i] = @ZERO@;
        state->model[i] = @ZERO@;
        state->trim_velocity[i] = @ZERO@;
    }
    for (unsigned int i = 0u; i < 3u; i++) {
        state->turn[i] = @ZERO@;
    }
    state->newest = 0u;
    state->velocity_mode = 0u;
    state->started = 0u;
}

/* Starts from a measurement without a transient. */
static void start(@P@_state *state, const @P@_measurement *m, const real *p, real vertical,
    const real ground[2])
{
    const real now[6] = { m->roll, m->pitch, m->rates[2], vertical, ground[0], ground[1] };
    @P@_reset(state);
    for (unsigned int i = 0u; i < 6u; i++) {
        state->reference[i][VALUE] = now[i];
        for (unsigned int k = 0u; k <= @U@_DELAY; k++) {
            state->history[k][i][VALUE] = now[i];
        }
    }
    const real st = @SIN@(m->pitch);
    const real ct = @COS@(m->pitch);
    const real sp = @SIN@(m->roll);
    /* Through the air as far as it is known: the forward airspeed is. */
    const real wind = m->airspeed - ground[0];
    const real air[2] = { m->velocity_body[0] + (wind * ct), m->velocity_body[1] + (wind * st * sp) };
    for (unsigned int i = 0u; i < 2u; i++) {
        state->velocity_command[i] = ground[i];
        state->trim_velocity[i] = p[@U@_TRIM_VELOCITY + i];
        state->model[i] = air[i] - p[@U@_TRIM_VELOCITY + i];
    }
    state->turn[VALUE] = ((m->rates[1] * sp) + (m->rates[2] * @COS@(m->roll))) / ct;
    state->started = 1u;
}

/* Second-order command model of an attitude. */
static void attitude_model(real reference[3], real command, real omega)
{
    reference[ACCELERATION] = (omega * omega * (command - reference[VALUE]))
        - (@TWO@ * ATTITUDE_DAMPING * omega * reference[RATE]);
    reference[RATE] += STEP * reference[ACCELERATION];
    reference[VALUE] += STEP * reference[RATE];
}

/* First-order command model of a rate or a velocity. */
static void lag_model(real reference[3], real command, real time_constant)
{
    reference[RATE] = (command - reference[VALUE]) / time_constant;
    reference[VALUE] += STEP * reference[RATE];
}

/* Velocity over the ground: down, and forward and to the right in heading
 * axes. */
static real earth_velocity(const @P@_measurement *m, real ground[2])
{
    const real sp = @SIN@(m->roll);
    const real cp = @COS@(m->roll);
    const real st = @SIN@(m->pitch);
    const real ct = @COS@(m->pitch);
    const real u = m->velocity_body[0];
    const real v = m->velocity_body[1];
    const real w = m->velocity_body[2];
    const real lifted = (v * sp) + (w * cp);
    ground[0] = (u * ct) + (lifted * st);
    ground[1] = (v * cp) - (w * sp);
    return (lifted * ct) - (u * st);
}

/* Enters or leaves the velocity mode, and gives the reference's velocities
 * that are now at the end of their delay. */
static void change_mode(@P@_state *state, unsigned int velocity_mode, const real ground[2],
    real due[2])
{
    if ((velocity_mode != 0u) && (state->velocity_mode == 0u)) {
        for (unsigned int k = 0u; k < 2u; k++) {
            state->velocity_command[k] = ground[k];
            state->velocity_rest[k] = @ZERO@;
            state->reference[VELOCITY + k][VALUE] = ground[k];
            state->reference[VELOCITY + k][RATE] = @ZERO@;
            state->reference[VELOCITY + k][ACCELERATION] = @ZERO@;
            for (unsigned int j = 0u; j <= @U@_DELAY; j++) {
                state->history[j][VELOCITY + k][VALUE] = ground[k];
                state->history[j][VELOCITY + k][RATE] = @ZERO@;
            }
            state->velocity_integral[k] = @ZERO@;
        }
    }
    state->velocity_mode = velocity_mode;
    /* The second oldest, which is the oldest after this step. */
    const unsigned int second = (state->newest + 2u) % (@U@_DELAY + 1u);
    due[0] = state->history[second][VELOCITY][VALUE];
    due[1] = state->history[second][VELOCITY + 1u][VALUE];
}

/* Horizontal acceleration per attitude of the inverted model at constant
 * vertical velocity: forward per pitch down, to the right per bank. Gravity
 * where the model's own is not positive. */
static void acceleration_per_attitude(const real *p, real per_attitude[2])
{
    /* Places among the references of the attitudes that move each velocity. */
    static const unsigned int ATTITUDE[2] = { PITCH, ROLL };
    for (unsigned int k = 0u; k < 2u; k++) {
        real model[2] = { @ZERO@, @ZERO@ };
        real sum = @ZERO@;
        for (unsigned int i = 0u; i < 8u; i++) {
            const real row = p[@U@_GROUND_VELOCITY + (8u * k) + i];
            model[0] += row * p[@U@_REFERENCE_STATE + (2u * i)];
            model[1] += row * p[@U@_REFERENCE_STATE + (2u * i) + 1u];
        }
        for (unsigned int i = 0u; i < 8u; i++) {
            const real rate = (model[0] * p[@U@_REFERENCE_DYNAMICS + i])
                + (model[1] * p[@U@_REFERENCE_DYNAMICS + 8u + i]);
            sum += rate * p[@U@_REFERENCE_INPUT + (6u * i) + ATTITUDE[k]];
        }
        const real own = (k == 0u) ? -sum : sum;
        per_attitude[k] = (own > (@HALF@ * GRAVITY)) ? own : GRAVITY;
    }
}

/* Translational rate command: attitudes from velocities forward and to the
 * right. */
static void velocity_loops(@P@_state *state, const real *p, const @P@_demand *demand,
    const real errors[2], real blend, real command[2])
{
    static const unsigned int ROWS[2] = { VX, VY };
    /* Where turn coordination has the bank, the lateral integral has nothing
     * to do and is forgotten. */
    const real share[2] = { @ONE@, @ONE@ - blend };
    real acceleration[2];
    real per_attitude[2];
    real limited[2];
    acceleration_per_attitude(p, per_attitude);
    for (unsigned int k = 0u; k < 2u; k++) {
        const real frequency = (k == 0u) ? PITCH_FREQUENCY : ROLL_FREQUENCY;
        acceleration[k] = held((demand->horizontal[k] - state->velocity_command[k]) * frequency
                / OUTER_SLOWNESS,
            -ACCELERATION_LIMIT, ACCELERATION_LIMIT);
        add(&state->velocity_command[k], &state->velocity_rest[k], STEP * acceleration[k]);
    }
    for (unsigned int k = 0u; k < 2u; k++) {
        const real *gains = &p[@U@_GAINS + (3u * ROWS[k])];
        real raw = (acceleration[k] / per_attitude[k])
            + (((gains[K_P] * errors[k]) + (gains[K_I] * state->velocity_integral[k])) / GRAVITY);
        if (k == 1u) {
            /* Heading axes turn: holding V_y takes V_x psi' of acceleration. */
            raw += @ATAN@(state->velocity_command[0] * demand->heading_rate / GRAVITY);
        }
        const real size = (raw < @ZERO@) ? -raw : raw;
        /* Anti-windup: hold while the attitude limit is reached. */
        if (!((size > ATTITUDE_LIMIT) && ((raw * errors[k]) > @ZERO@))) {
            state->velocity_integral[k] += STEP * share[k] * errors[k];
        }
        state->velocity_integral[k] *= @ONE@ - (STEP * (@ONE@ - share[k]) / FORGETTING);
        limited[k] = held(raw, -ATTITUDE_LIMIT, ATTITUDE_LIMIT);
    }
    command[ROLL] = p[@U@_TRIM_ATTITUDE + ROLL] + limited[1];
    command[PITCH] = p[@U@_TRIM_ATTITUDE + PITCH] - limited[0];
}

/* A row of F with its velocity terms times kappa, times a deviation. */
static real cancelled(const real row[8], const real x[8])
{
    real sum = row[0] * KAPPA * x[0];
    for (unsigned int j = 1u; j < 8u; j++) {
        sum += ((j < 3u) ? (row[j] * KAPPA) : row[j]) * x[j];
    }
    return sum;
}

/* Exact kinematics of the references: in a turn the aircraft also pitches and
 * rolls; and under a velocity demand its velocities are known, and need no
 * model of their own. */
static void refine(@P@_state *state, real ideal[8], const real trim_velocity[3], real wind,
    real blend)
{
    const real sr = @SIN@(state->reference[ROLL][VALUE]);
    const real cr = @COS@(state->reference[ROLL][VALUE]);
    const real sp = @SIN@(state->reference[PITCH][VALUE]);
    const real cp = @COS@(state->reference[PITCH][VALUE]);
    const real bank_rate = state->reference[ROLL][RATE];
    const real pitch_rate = state->reference[PITCH][RATE];
    const real yaw_rate = state->reference[YAW][VALUE];
    const real turn = (yaw_rate + (pitch_rate * sr)) / (cp * cr);
    ideal[3] = bank_rate - (turn * sp);
    ideal[4] = (pitch_rate * cr) + (turn * cp * sr);
    ideal[5] = yaw_rate;
    if (state->velocity_mode != 0u) {
        const real along = state->reference[VELOCITY][VALUE] + wind;
        const real down = state->reference[HEAVE][VALUE];
        const real lifted = (along * sp) + (down * cp);
        /* A coordinated turn leaves no v. */
        const real across = ((@ONE@ - blend) * state->reference[VELOCITY + 1u][VALUE])
            - (blend * lifted * sr / cr);
        ideal[0] = ((along * cp) - (down * sp)) - trim_velocity[0];
        ideal[1] = ((across * cr) + (lifted * sr)) - trim_velocity[1];
        ideal[2] = ((lifted * cr) - (across * sr)) - trim_velocity[2];
        state->model[0] = ideal[0];
        state->model[1] = ideal[1];
    }
}

/* Power of the pedals over yaw, relative to the trim's, at a change of
 * collective from it. */
static real pedal_power(const real *p, real collective)
{
    const real per_power = p[@U@_DECOUPLING + (4u * @U@_PED) + YAW];
    return held(@ONE@ + (PEDAL_YAW_GROWTH * per_power * collective), PEDAL_POWER_MIN,
        PEDAL_POWER_MAX);
}
@LIFT@
static void run(@P@_state *state, const @P@_measurement *m, const @P@_demand *demand)
{
    real p[@U@_VALUES];
    real ground[2];
    real due[2];
    const real sp = @SIN@(m->roll);
    const real cp = @COS@(m->roll);
    const real st = @SIN@(m->pitch);
    const real ct = @COS@(m->pitch);
    const real vertical = earth_velocity(m, ground);
    const unsigned int velocity_mode = (demand->mode == @U@_VELOCITY) ? 1u : 0u;

    if (state->started == 0u) {
        @P@_at(m->airspeed, p);
        start(state, m, p, vertical, ground);
    }
    change_mode(state, velocity_mode, ground, due);
    const real off[2] = { due[0] - ground[0], due[1] - ground[1] };
    const real lead = (velocity_mode != 0u) ? held(off[0], -SCHEDULE_LEAD, SCHEDULE_LEAD) : @ZERO@;
    const real scheduled = m->airspeed + lead;
    @P@_at((scheduled > @ZERO@) ? scheduled : @ZERO@, p);
    const real *trim_velocity = &p[@U@_TRIM_VELOCITY];
    const real trim_roll = p[@U@_TRIM_ATTITUDE + ROLL];
    const real trim_pitch = p[@U@_TRIM_ATTITUDE + PITCH];

    /* Outer loops and turn coordination. */
    const real blend = @P@_turn_blend(m->airspeed);
    const real coordinated = @ATAN@(m->airspeed * demand->heading_rate / GRAVITY);
    real command[2] = { demand->horizontal[0], demand->horizontal[1] };
    if (velocity_mode != 0u) {
        velocity_loops(state, p, demand, off, blend, command);
    }
    const real roll_command
        = ((@ONE@ - blend) * command[ROLL]) + (blend * (trim_roll + coordinated));
    /* Command models, and their past. */
    attitude_model(state->reference[ROLL], roll_command, ROLL_FREQUENCY);
    attitude_model(state->reference[PITCH], command[PITCH], PITCH_FREQUENCY);
    if (velocity_mode != 0u) {
        /* What the aircraft can do of a velocity: the attitude command model
         * stands between. */
        attitude_model(
            state->reference[VELOCITY], state->velocity_command[0], PITCH_FREQUENCY);
        attitude_model(
            state->reference[VELOCITY + 1u], state->velocity_command[1], ROLL_FREQUENCY);
    }
    /* The heading turns no sooner than the bank that must go with it. */
    attitude_model(state->turn, demand->heading_rate, ROLL_FREQUENCY);
    const real together = held(YAW_LEAD * m->airspeed / TURN_SPEED, @ZERO@, @ONE@);
    const real led = state->turn[VALUE] + (YAW_TIME_CONSTANT * state->turn[RATE]);
    const real heading_rate = ((@ONE@ - together) * demand->heading_rate) + (together * led);
    /* In a coordinated turn the aircraft rolls about its flight path: to keep v
     * at zero, rolling with w asks for yaw, p w = r u. */
    const real slope = (trim_velocity[0] > SLOW)
        ? (blend * trim_velocity[2] / trim_velocity[0])
        : @ZERO@;
    const real *bank = state->reference[ROLL];
    const real rolling = slope * (bank[RATE] + (YAW_TIME_CONSTANT * bank[ACCELERATION]));
    /* Heading rate to body yaw rate, at the attitude flown. */
    const real yaw_command = (heading_rate * cp * ct) + rolling;
    lag_model(state->reference[YAW], yaw_command, YAW_TIME_CONSTANT);
    lag_model(state->reference[HEAVE], demand->vertical_velocity, HEAVE_TIME_CONSTANT);
    state->newest = (state->newest == @U@_DELAY) ? 0u : (state->newest + 1u);
    for (unsigned int i = 0u; i < 6u; i++) {
        state->history[state->newest][i][VALUE] = state->reference[i][VALUE];
        state->history[state->newest][i][RATE] = state->reference[i][RATE];
    }
    const unsigned int oldest = (state->newest == @U@_DELAY) ? 0u : (state->newest + 1u);

    /* Accelerations of the outputs phi, theta, r, V_z: commanded, and asked for
     * by feedback. */
    const real feed[4] = { state->reference[ROLL][ACCELERATION],
        state->reference[PITCH][ACCELERATION], state->reference[YAW][RATE],
        state->reference[HEAVE][RATE] };
    const real measured[4] = { m->roll, m->pitch, m->rates[2], vertical };
    const real measured_rate[2]
        = { m->rates[0] + (st / ct * ((m->rates[1] * sp) + (m->rates[2] * cp))),
              (m->rates[1] * cp) - (m->rates[2] * sp) };
    /* Deviation from the trim, through the air as far as it is known: the
     * forward airspeed is. */
    const real wind = m->airspeed - ground[0];
    const real x[8] = { (m->velocity_body[0] + (wind * ct)) - trim_velocity[0],
        (m->velocity_body[1] + (wind * st * sp)) - trim_velocity[1],
        (m->velocity_body[2] + (wind * st * cp)) - trim_velocity[2],
        m->rates[0], m->rates[1], m->rates[2], m->roll - trim_roll, m->pitch - trim_pitch };
    real errors[4];
    real commanded[4];
    real nu[4];
    for (unsigned int i = 0u; i < 4u; i++) {
        const real *gains = &p[@U@_GAINS + (3u * i)];
        errors[i] = state->history[oldest][i][VALUE] - measured[i];
        commanded[i] = feed[i];
        nu[i] = (gains[K_P] * errors[i]) + (gains[K_I] * state->integral[i]);
        if (i < 2u) {
            nu[i] += gains[K_D] * (state->history[oldest][i][RATE] - measured_rate[i]);
        }
        nu[i] -= cancelled(&p[@U@_FEEDBACK + (8u * i)], x);
    }

    /* The reference model's deviation is from the trim at the scheduled speed:
     * when that moves, the deviation moves the other way. */
    for (unsigned int k = 0u; k < 2u; k++) {
        state->model[k] -= trim_velocity[k] - state->trim_velocity[k];
        state->trim_velocity[k] = trim_velocity[k];
    }
    const real rho[6] = { state->reference[ROLL][VALUE] - trim_roll,
        state->reference[PITCH][VALUE] - trim_pitch, state->reference[ROLL][RATE],
        state->reference[PITCH][RATE], state->reference[YAW][VALUE],
        state->reference[HEAVE][VALUE] };
    real ideal[8];
    for (unsigned int i = 0u; i < 8u; i++) {
        ideal[i] = dot(&p[@U@_REFERENCE_STATE + (2u * i)], state->model, 2u)
            + dot(&p[@U@_REFERENCE_INPUT + (6u * i)], rho, 6u);
    }
    refine(state, ideal, trim_velocity, wind, blend);
@LIFTING@@HYBRID@    if (velocity_mode == 0u) {
        for (unsigned int k = 0u; k < 2u; k++) {
            state->model[k] += STEP
                * (dot(&p[@U@_REFERENCE_DYNAMICS + (8u * k)], ideal, 8u)
                    + dot(&p[@U@_REFERENCE_DRIVE + (4u * k)], feed, 4u));
        }
    }

    /* Inversion and limits. */
    const real *trim_sticks = &p[@U@_TRIM_STICKS];
    real delta[4];
    real wanted[4];
    for (unsigned int j = 0u; j < 4u; j++) {
        delta[j] = @DELTA@;
    }
    const real collective
        = held(trim_sticks[@U@_COL] + delta[@U@_COL], LIMITS[@U@_COL][0], LIMITS[@U@_COL][1])
        - trim_sticks[@U@_COL];
    delta[@U@_PED] /= pedal_power(p, collective);
    for (unsigned int j = 0u; j < 4u; j++) {
        wanted[j] = trim_sticks[j] + delta[j];
        state->sticks[j] = held(wanted[j], LIMITS[j][0], LIMITS[j][1]);
    }
    /* Anti-windup: an axis's integral holds while its own effector is at a
     * limit and the error would push it further. */
    for (unsigned int i = 0u; i < 4u; i++) {
        const unsigned int e = EFFECTOR[i];
        const real push = p[@U@_ALLOCATION + (4u * e) + i] * errors[i];
        if (!(((wanted[e] > LIMITS[e][1]) && (push > @ZERO@))
                || ((wanted[e] < LIMITS[e][0]) && (push < @ZERO@)))) {
            state->integral[i] += STEP * errors[i];
        }
    }
}

static unsigned int usable(const @P@_measurement *m, const @P@_demand *demand)
{
    const real other[7] = { m->roll, m->pitch, m->airspeed, demand->horizontal[0],
        demand->horizontal[1], demand->heading_rate, demand->vertical_velocity };
    return ((all_finite(m->velocity_body, 3u) != 0u) && (all_finite(m->rates, 3u) != 0u)
               && (all_finite(other, 7u) != 0u))
        ? 1u
        : 0u;
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

/* What the inversion must ask of the pedals for these sticks. */
static real asked_pedal(const real *p, const real sticks[4])
{
    const real *trim_sticks = &p[@U@_TRIM_STICKS];
    return (sticks[@U@_PED] - trim_sticks[@U@_PED])
        * pedal_power(p, sticks[@U@_COL] - trim_sticks[@U@_COL]);
}

@P@_status @P@_engage(@P@_state *state, const @P@_measurement *measurement,
    const @P@_demand *demand, const @P@_real sticks[4])
{
    @P@_status status = @U@_BAD_INPUT;
    if ((usable(measurement, demand) != 0u) && (all_finite(sticks, 4u) != 0u)) {
        real p[@U@_VALUES];
        real ground[2];
        const real vertical = earth_velocity(measurement, ground);
        @P@_at(measurement->airspeed, p);
        start(state, measurement, p, vertical, ground);
        if (demand->mode == @U@_VELOCITY) {
            /* The attitude now asked for is the one flown. */
            static const unsigned int ROWS[2] = { VX, VY };
            const real attitude[2] = { p[@U@_TRIM_ATTITUDE + PITCH] - measurement->pitch,
                measurement->roll - p[@U@_TRIM_ATTITUDE + ROLL] };
            state->velocity_mode = 1u;
            for (unsigned int k = 0u; k < 2u; k++) {
                const real k_i = p[@U@_GAINS + (3u * ROWS[k]) + K_I];
                if (k_i > @ZERO@) {
                    state->velocity_integral[k] = GRAVITY * attitude[k] / k_i;
                }
            }
        }
        /* What the law would answer by itself. */
        @P@_state trial = *state;
        run(&trial, measurement, demand);
        real matrix[4][4];
        real lacking[4];
        for (unsigned int i = 0u; i < 4u; i++) {
            /* Pedals as the inversion asks for them, at the trim's power. */
            lacking[i] = (i == @U@_PED) ? (asked_pedal(p, sticks) - asked_pedal(p, trial.sticks))
                                        : (sticks[i] - trial.sticks[i]);
            for (unsigned int j = 0u; j < 4u; j++) {
                matrix[i][j] = p[@U@_ALLOCATION + (4u * i) + j];
            }
        }
        if (solve(matrix, lacking) != 0u) {
            for (unsigned int i = 0u; i < 4u; i++) {
                const real k_i = p[@U@_GAINS + (3u * i) + K_I];
                if (k_i > @ZERO@) {
                    state->integral[i] = lacking[i] / k_i;
                }
            }
        }
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
        run(state, measurement, demand);
        status = @U@_OK;
    }
    for (unsigned int j = 0u; j < 4u; j++) {
        sticks[j] = state->sticks[j];
    }
    return status;
}
