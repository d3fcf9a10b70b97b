/*
 * The control law of @P@ as an FMI 2.0 unit for co-simulation.
@WARNINGS@ *
 * Written against the FMI 2.0 standard; the few types of its headers that are
 * needed are declared here, so that the sources compile by themselves.
 */
#include "@P@_law.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum {
    fmi2DoStepStatus,
    fmi2PendingStatus,
    fmi2LastSuccessfulTime,
    fmi2Terminated
} fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String,
    fmi2String, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

/* Value references: inputs, then outputs, then the mode. */
#define INPUTS (19u)
#define OUTPUTS (4u)
#define MODE (23u)
#define RESET (13u)
#define ENGAGE (14u)
#define GIVEN (15u) /* sticks to engage from */

typedef struct {
    @P@_state law;
    fmi2Real input[INPUTS];
    fmi2Real output[OUTPUTS];
    fmi2Integer mode;
    fmi2Real time;
    fmi2Real start;
    unsigned long done; /* steps since the start */
    int initialising;   /* outputs follow the inputs without a step */
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    char name[64];
} unit;

static void tell(const unit *u, fmi2Status status, const char *text)
{
    if (u->logger != NULL) {
        u->logger(u->environment, u->name, status, "logStatusError", text);
    }
}

/* One step of a law, or its start from given sticks. */
static @P@_status answer(const unit *u, @P@_state *law, int engage, @P@_real sticks[4])
{
    const fmi2Real *x = u->input;
    const @P@_measurement m = { { (@P@_real)x[0], (@P@_real)x[1], (@P@_real)x[2] },
        { (@P@_real)x[3], (@P@_real)x[4], (@P@_real)x[5] }, (@P@_real)x[6], (@P@_real)x[7],
        (@P@_real)x[8] };
    const @P@_demand demand = { (u->mode == 1) ? @U@_VELOCITY : @U@_ATTITUDE,
        { (@P@_real)x[9], (@P@_real)x[10] }, (@P@_real)x[11], (@P@_real)x[12] };
    if (engage != 0) {
        const @P@_real given[4] = { (@P@_real)x[GIVEN], (@P@_real)x[GIVEN + 1u],
            (@P@_real)x[GIVEN + 2u], (@P@_real)x[GIVEN + 3u] };
        const @P@_status status = @P@_engage(law, &m, &demand, given);
        if (status != @U@_OK) {
            return status;
        }
    }
    return @P@_step(law, &m, &demand, sticks);
}

/* Outputs that the inputs ask for, without a step: the law answers on a copy of
 * its memory. */
static fmi2Status settle(unit *u)
{
    @P@_state copy = u->law;
    @P@_real sticks[4];
    if (answer(u, &copy, u->input[ENGAGE] > 0.5, sticks) != @U@_OK) {
        tell(u, fmi2Error, "an input is not finite");
        return fmi2Error;
    }
    for (unsigned int j = 0u; j < OUTPUTS; j++) {
        u->output[j] = (fmi2Real)sticks[j];
    }
    return fmi2OK;
}

static void restart(unit *u)
{
    (void)memset(u->input, 0, sizeof u->input);
    u->mode = 0;
    u->time = 0.0;
    u->start = 0.0;
    u->done = 0ul;
    u->initialising = 0;
    @P@_reset(&u->law);
    for (unsigned int j = 0u; j < OUTPUTS; j++) {
        u->output[j] = (fmi2Real)u->law.sticks[j];
    }
}

EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORT fmi2Status fmi2SetDebugLogging(
    fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)categories;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
    fmi2String resources, const fmi2CallbackFunctions *functions, fmi2Boolean visible,
    fmi2Boolean logging)
{
    unit *u = NULL;
    (void)resources;
    (void)visible;
    (void)logging;
    if ((type == fmi2CoSimulation) && (guid != NULL) && (strcmp(guid, "@GUID@") == 0)) {
        u = (unit *)calloc(1u, sizeof *u);
    }
    if (u != NULL) {
        if (functions != NULL) {
            u->logger = functions->logger;
            u->environment = functions->componentEnvironment;
        }
        if (name != NULL) {
            (void)strncpy(u->name, name, sizeof u->name - 1u);
        }
        restart(u);
    }
    return u;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined,
    fmi2Real tolerance, fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    unit *u = (unit *)c;
    (void)tolerance_defined;
    (void)tolerance;
    (void)stop_defined;
    (void)stop;
    u->time = start;
    u->start = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    ((unit *)c)->initialising = 1;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    unit *u = (unit *)c;
    u->initialising = 0;
    return settle(u);
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    restart((unit *)c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Real value[])
{
    unit *u = (unit *)c;
    if ((u->initialising != 0) && (settle(u) != fmi2OK)) {
        return fmi2Error;
    }
    for (size_t k = 0u; k < count; k++) {
        if (vr[k] < INPUTS) {
            value[k] = u->input[vr[k]];
        } else if (vr[k] < (INPUTS + OUTPUTS)) {
            value[k] = u->output[vr[k] - INPUTS];
        } else {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Real value[])
{
    unit *u = (unit *)c;
    for (size_t k = 0u; k < count; k++) {
        if (vr[k] >= INPUTS) {
            return fmi2Error;
        }
        u->input[vr[k]] = value[k];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Integer value[])
{
    for (size_t k = 0u; k < count; k++) {
        if (vr[k] != MODE) {
            return fmi2Error;
        }
        value[k] = ((const unit *)c)->mode;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetInteger(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Integer value[])
{
    for (size_t k = 0u; k < count; k++) {
        if ((vr[k] != MODE) || (value[k] < 0) || (value[k] > 1)) {
            return fmi2Error;
        }
        ((unit *)c)->mode = value[k];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBoolean(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Boolean value[])
{
    (void)c;
    (void)vr;
    (void)value;
    return (count == 0u) ? fmi2OK : fmi2Error;
}

EXPORT fmi2Status fmi2SetBoolean(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Boolean value[])
{
    (void)c;
    (void)vr;
    (void)value;
    return (count == 0u) ? fmi2OK : fmi2Error;
}

EXPORT fmi2Status fmi2GetString(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2String value[])
{
    (void)c;
    (void)vr;
    (void)value;
    return (count == 0u) ? fmi2OK : fmi2Error;
}

EXPORT fmi2Status fmi2SetString(
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2String value[])
{
    (void)c;
    (void)vr;
    (void)value;
    return (count == 0u) ? fmi2OK : fmi2Error;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(unit));
    }
    if (*state == NULL) {
        return fmi2Error;
    }
    (void)memcpy(*state, c, sizeof(unit));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    (void)memcpy(c, state, sizeof(unit));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c;
    (void)state;
    (void)size;
    return fmi2Error;
}

EXPORT fmi2Status fmi2SerializeFMUstate(
    fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    (void)c;
    (void)state;
    (void)bytes;
    (void)size;
    return fmi2Error;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(
    fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    (void)c;
    (void)bytes;
    (void)size;
    (void)state;
    return fmi2Error;
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c,
    const fmi2ValueReference unknown[], size_t unknowns, const fmi2ValueReference known[],
    size_t knowns, const fmi2Real seed[], fmi2Real value[])
{
    (void)c;
    (void)unknown;
    (void)unknowns;
    (void)known;
    (void)knowns;
    (void)seed;
    (void)value;
    return fmi2Error;
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
    size_t count, const fmi2Integer order[], const fmi2Real value[])
{
    (void)c;
    (void)vr;
    (void)count;
    (void)order;
    (void)value;
    return fmi2Error;
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[],
    size_t count, const fmi2Integer order[], fmi2Real value[])
{
    (void)c;
    (void)vr;
    (void)count;
    (void)order;
    (void)value;
    return fmi2Error;
}

/* The law answers at every multiple of its own step since the start, with the
 * inputs that were set before, so that a communication step of n of its steps
 * runs it n times; a shorter one waits until the next step is due. */
EXPORT fmi2Status fmi2DoStep(
    fmi2Component c, fmi2Real now, fmi2Real size, fmi2Boolean no_set_state)
{
    unit *u = (unit *)c;
    const fmi2Real end = now + size;
    /* A thousandth of a step, for times that were summed up. */
    const fmi2Real slack = 0.001 * (fmi2Real)@U@_STEP;
    (void)no_set_state;
    if (!(size >= 0.0)) {
        return fmi2Error;
    }
    if (u->input[RESET] > 0.5) {
        @P@_reset(&u->law);
    }
    /* Once a communication step, and at the first step from what the
     * initialisation asked for. */
    int engage = u->input[ENGAGE] > 0.5;
    while ((u->start + ((fmi2Real)u->done * (fmi2Real)@U@_STEP) + slack) < end) {
        @P@_real sticks[4];
        if (answer(u, &u->law, engage, sticks) != @U@_OK) {
            tell(u, fmi2Discard, "an input is not finite");
            return fmi2Discard;
        }
        for (unsigned int j = 0u; j < OUTPUTS; j++) {
            u->output[j] = (fmi2Real)sticks[j];
        }
        engage = 0;
        u->done++;
    }
    u->time = end;
    return fmi2OK;
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

EXPORT fmi2Status fmi2GetStatus(fmi2Component c, fmi2StatusKind kind, fmi2Status *value)
{
    (void)c;
    (void)kind;
    (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = ((const unit *)c)->time;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, fmi2StatusKind kind, fmi2Integer *value)
{
    (void)c;
    (void)kind;
    (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, fmi2StatusKind kind, fmi2Boolean *value)
{
    if (kind != fmi2Terminated) {
        return fmi2Discard;
    }
    (void)c;
    *value = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, fmi2StatusKind kind, fmi2String *value)
{
    (void)c;
    (void)kind;
    (void)value;
    return fmi2Discard;
}
