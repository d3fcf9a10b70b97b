/*
@BANNER@ */
#ifndef @U@_LAW_H
#define @U@_LAW_H

#ifdef __cplusplus
extern "C" {
#endif

/* Every number of the law. */
typedef @REAL@ @P@_real;

/* Interval at which @P@_step is to be called, s. */
#define @U@_STEP (@STEP@)

/* Breakpoints of the tables. */
#define @U@_BREAKPOINTS (@NB@u)

/* Steps by which the references are delayed in the error path. */
#define @U@_DELAY (@ND@u)

/* Numbers of the law at one speed, and the place of each table's first one;
 * entries follow by rows. */
#define @U@_VALUES (@NV@u)
@PLACES@
/* Sticks, in the order of every four of them; percent. */
#define @U@_LAT (0u)
#define @U@_LON (1u)
#define @U@_COL (2u)
#define @U@_PED (3u)

/* What the law measures. */
typedef struct {
    @P@_real velocity_body[3]; /* over the ground, body axes u, v, w, m/s */
    @P@_real rates[3];         /* p, q, r, rad/s */
    @P@_real roll;             /* bank angle, rad */
    @P@_real pitch;            /* pitch angle, rad */
    @P@_real airspeed;         /* forward component of the true airspeed, heading axes, m/s */
} @P@_measurement;

/* Response type of the horizontal axes. */
typedef enum {
    @U@_ATTITUDE = 0, /* horizontal[] is bank and pitch, rad */
    @U@_VELOCITY = 1  /* horizontal[] is ground velocity forward and right, heading axes, m/s */
} @P@_mode;

/* What the pilot or guidance asks for. */
typedef struct {
    @P@_mode mode;
    @P@_real horizontal[2];
    @P@_real heading_rate;      /* rad/s */
    @P@_real vertical_velocity; /* down positive, m/s */
} @P@_demand;

/* Places in a delay line. */
#define @U@_LINE (@NL@u)

/* The law's memory. Its members are private. */
typedef struct {
@MEMBERS@    unsigned int oldest; /* place of the delay lines' oldest numbers */
    @P@_real sticks[4];
} @P@_state;

/* Outcome of a step. */
typedef enum {
    @U@_OK = 0,
    @U@_BAD_INPUT = 1 /* an input is not finite: the last sticks are kept */
} @P@_status;

/* Forgets everything. The next step starts from what it measures: references
 * there, integrals at zero. Before the first step the sticks are those of the
 * trim at the lowest speed. */
void @P@_reset(@P@_state *state);

/* One step. Writes the sticks lat, lon, col, ped in percent, within their
 * limits. The only memory is *state; any number of laws may run side by side. */
@P@_status @P@_step(@P@_state *state, const @P@_measurement *measurement,
    const @P@_demand *demand, @P@_real sticks[4]);

/* Starts from a measurement with given sticks and without a transient: the
 * integrals take what the law would otherwise lack, so that the next step's
 * sticks are these. To be called in place of @P@_reset when the law is switched
 * on in flight. */
@P@_status @P@_engage(@P@_state *state, const @P@_measurement *measurement,
    const @P@_demand *demand, const @P@_real sticks[4]);

/* The tables at a true airspeed in m/s: linear between breakpoints, constant
 * beyond the ends. */
void @P@_at(@P@_real airspeed, @P@_real values[@U@_VALUES]);

/* Weight of turn coordination at a true airspeed: 0 below the blend, 1 above. */
@P@_real @P@_turn_blend(@P@_real airspeed);

#ifdef __cplusplus
}
#endif

#endif
