/* A ball in Model Exchange of FMI 2.0, without directional derivatives. It aborts on calls in a wrong mode and after an error,
 * refuses to be evaluated far below the ground, has a time event, and asks for one event after an integrator's step. */

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { H, V, DER_H, DER_V, G, RESTITUTION, TIME_EVENTS, STEP_EVENTS, FAIL, VARIABLES };
enum mode { INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, FAILED };
enum { OK = 0, DISCARD = 2, ERROR = 3 };

typedef struct {
    void (*log)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} callbacks;

typedef struct {
    int needed, terminate, nominals, values, next_defined;
    double next;
} event_info;

typedef struct {
    enum mode mode;
    double time, steps, values[VARIABLES];
    const callbacks *functions;
} ball;

static ball *in(void *instance, unsigned modes)
{
    ball *self = instance;
    if (!(modes >> self->mode & 1))
        abort();
    return self;
}

#define ANY 15u
#define SETTABLE (1u << INSTANTIATED | 1u << INITIALIZATION | 1u << EVENT)

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const callbacks *functions,
                      int visible, int logging)
{
    (void)name, (void)guid, (void)resources, (void)visible, (void)logging;
    ball *self = calloc(1, sizeof *self);
    if (self == NULL || type != 0)
        abort();
    self->functions = functions;
    self->values[H] = 1;
    self->values[G] = -10;
    self->values[RESTITUTION] = 0.5;
    return self;
}

void fmi2FreeInstance(void *instance)
{
    free(instance);
}

int fmi2SetupExperiment(void *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    in(instance, 1u << INSTANTIATED)->time = start;
    return OK;
}

int fmi2EnterInitializationMode(void *instance)
{
    in(instance, 1u << INSTANTIATED)->mode = INITIALIZATION;
    return OK;
}

int fmi2ExitInitializationMode(void *instance)
{
    in(instance, 1u << INITIALIZATION)->mode = EVENT;
    return OK;
}

int fmi2Terminate(void *instance)
{
    in(instance, 1u << EVENT | 1u << CONTINUOUS);
    return OK;
}

int fmi2EnterEventMode(void *instance)
{
    in(instance, 1u << CONTINUOUS)->mode = EVENT;
    return OK;
}

int fmi2EnterContinuousTimeMode(void *instance)
{
    in(instance, 1u << EVENT)->mode = CONTINUOUS;
    return OK;
}

int fmi2NewDiscreteStates(void *instance, event_info *info)
{
    ball *self = in(instance, 1u << EVENT);
    double *values = self->values;
    memset(info, 0, sizeof *info);
    /* One more update after each change. */
    if (values[H] <= 0 && values[V] < 0) {
        values[V] *= -values[RESTITUTION];
        info->needed = info->values = 1;
    } else if (self->time >= 0.25 * (values[TIME_EVENTS] + 1)) {
        ++values[TIME_EVENTS];
        info->needed = 1;
    } else if (self->steps == 3) {
        ++values[STEP_EVENTS];
        ++self->steps;
    }
    info->next_defined = 1;
    info->next = 0.25 * (values[TIME_EVENTS] + 1);
    return OK;
}

int fmi2SetTime(void *instance, double time)
{
    in(instance, 1u << CONTINUOUS)->time = time;
    return OK;
}

int fmi2SetContinuousStates(void *instance, const double *states, size_t count)
{
    if (count != 2)
        abort();
    memcpy(in(instance, 1u << CONTINUOUS)->values, states, 2 * sizeof *states);
    return OK;
}

int fmi2GetContinuousStates(void *instance, double *states, size_t count)
{
    memcpy(states, in(instance, 1u << EVENT | 1u << CONTINUOUS)->values, count * sizeof *states);
    return OK;
}

int fmi2GetNominalsOfContinuousStates(void *instance, double *nominals, size_t count)
{
    in(instance, 1u << EVENT | 1u << CONTINUOUS);
    /* Not allowed: they are above 0. */
    memset(nominals, 0, count * sizeof *nominals);
    return OK;
}

int fmi2GetDerivatives(void *instance, double *derivatives, size_t count)
{
    ball *self = in(instance, 1u << EVENT | 1u << CONTINUOUS);
    if (count != 2)
        abort();
    if (self->values[FAIL] != 0) {
        self->functions->log(self->functions->environment, "ball", ERROR, "", "it fell into a %s", "hole");
        self->mode = FAILED;
        return ERROR;
    }
    if (self->values[H] < -0.005)
        return DISCARD;
    derivatives[0] = self->values[V];
    derivatives[1] = self->values[G];
    return OK;
}

int fmi2GetEventIndicators(void *instance, double *indicators, size_t count)
{
    if (count != 1)
        abort();
    /* Above 0 on the ground, too, while the ball rises. */
    const double *values = in(instance, 1u << EVENT | 1u << CONTINUOUS)->values;
    indicators[0] = values[H] <= 0 && values[V] > 0 ? 1e-12 : values[H];
    return OK;
}

int fmi2CompletedIntegratorStep(void *instance, int no_restore, int *enter_event_mode, int *terminate)
{
    ball *self = in(instance, 1u << CONTINUOUS);
    (void)no_restore;
    *enter_event_mode = ++self->steps == 3;
    *terminate = 0;
    return OK;
}

int fmi2GetReal(void *instance, const unsigned *references, size_t count, double *values)
{
    for (size_t i = 0; i < count; ++i)
        values[i] = in(instance, ANY)->values[references[i]];
    return OK;
}

int fmi2SetReal(void *instance, const unsigned *references, size_t count, const double *values)
{
    for (size_t i = 0; i < count; ++i) {
        /* A continuous input may be set between events. */
        unsigned modes = SETTABLE | (references[i] == G ? 1u << CONTINUOUS : 0);
        in(instance, modes)->values[references[i]] = values[i];
    }
    return OK;
}

#define UNUSED(name)                                                                                                   \
    int name(void *instance)                                                                                           \
    {                                                                                                                  \
        (void)instance;                                                                                                \
        return ERROR;                                                                                                  \
    }

UNUSED(fmi2GetInteger)
UNUSED(fmi2SetInteger)
UNUSED(fmi2GetBoolean)
UNUSED(fmi2SetBoolean)
UNUSED(fmi2SetString)

int fmi2GetFMUstate(void *instance, ball **state)
{
    *state = malloc(sizeof **state);
    if (*state == NULL)
        abort();
    **state = *in(instance, ANY);
    return OK;
}

int fmi2SetFMUstate(void *instance, const ball *state)
{
    *(ball *)instance = *state;
    return OK;
}

int fmi2FreeFMUstate(void *instance, ball **state)
{
    (void)instance;
    free(*state);
    return OK;
}
