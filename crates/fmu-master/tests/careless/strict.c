/* An FMU of FMI 2.0 for co-simulation and Model Exchange that refuses what the standard does not allow: to be read between
 * the setting of an input and the step (section 4.2.4), and to step beyond the stop time. It adds up its input u once a
 * period, and computes the times by sums, which round. */

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { OK = 0, DISCARD = 2, ERROR = 3 };
enum { U, Y, SUM, X, DERIVATIVE, PERIOD, OFFSET, ENDS, STOP, TOLERANCE, GOES_BACK, REALS };
enum { COUNT = REALS, FLAG, GEAR, VARIABLES };

typedef struct {
    double real[REALS], time, due;
    int whole[VARIABLES];
    bool is_exchange, is_initialized, is_set;
} instance;

struct info {
    int needed, terminate, nominals, values_changed, next_defined;
    double next;
};

static void observe(instance *self)
{
    self->real[Y] = self->real[U] + self->real[OFFSET];
    self->real[DERIVATIVE] = self->real[U];
}

static void sample(instance *self)
{
    if (self->time >= self->due - 1e-9) {
        self->real[SUM] += self->real[U];
        self->due += self->real[PERIOD];
    }
}

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *functions, int visible,
                      int logging)
{
    (void)name, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
    instance *self = calloc(1, sizeof *self);
    self->is_exchange = type == 0;
    self->real[PERIOD] = 0.25;
    self->real[ENDS] = INFINITY;
    return self;
}

void fmi2FreeInstance(void *self) { free(self); }

int fmi2SetupExperiment(void *component, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    instance *self = component;
    self->time = start;
    self->real[STOP] = has_stop ? stop : INFINITY;
    self->real[TOLERANCE] = has_tolerance ? tolerance : 0;
    return OK;
}

int fmi2EnterInitializationMode(void *self) { return self == NULL ? ERROR : OK; }

int fmi2ExitInitializationMode(void *component)
{
    instance *self = component;
    observe(self);
    self->is_initialized = true;
    self->is_set = false;
    return OK;
}

int fmi2Terminate(void *self) { return self == NULL ? ERROR : OK; }

int fmi2DoStep(void *component, double time, double size, int no_way_back)
{
    instance *self = component;
    if (time + size > self->real[STOP])
        return ERROR;
    self->real[GOES_BACK] += !no_way_back;
    self->is_set = false;
    self->time = time;
    sample(self);
    bool ends = time + size > self->real[ENDS];
    self->time = ends ? self->real[ENDS] : time + size;
    self->real[X] += self->real[U] * (self->time - time);
    observe(self);
    return ends ? DISCARD : OK;
}

int fmi2GetBooleanStatus(void *self, int kind, int *terminated)
{
    (void)kind;
    *terminated = 1;
    return self == NULL ? ERROR : OK;
}

int fmi2GetRealStatus(void *self, int kind, double *reached)
{
    (void)kind;
    *reached = ((instance *)self)->time;
    return OK;
}

static bool may_be_read(instance *self)
{
    if (self->is_exchange || !self->is_initialized)
        observe(self);
    return self->is_exchange || !self->is_initialized || !self->is_set;
}

int fmi2GetReal(void *self, const unsigned *references, size_t count, double *values)
{
    if (!may_be_read(self))
        return ERROR;
    for (size_t i = 0; i < count; i++)
        values[i] = ((instance *)self)->real[references[i]];
    return OK;
}

int fmi2GetInteger(void *self, const unsigned *references, size_t count, int *values)
{
    if (!may_be_read(self))
        return ERROR;
    for (size_t i = 0; i < count; i++)
        values[i] = ((instance *)self)->whole[references[i]];
    return OK;
}

int fmi2GetBoolean(void *self, const unsigned *references, size_t count, int *values)
{
    return fmi2GetInteger(self, references, count, values);
}

int fmi2SetReal(void *component, const unsigned *references, size_t count, const double *values)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++)
        self->real[references[i]] = values[i];
    self->is_set = true;
    return OK;
}

int fmi2SetInteger(void *component, const unsigned *references, size_t count, const int *values)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++)
        self->whole[references[i]] = values[i];
    self->is_set = true;
    return OK;
}

int fmi2SetBoolean(void *self, const unsigned *references, size_t count, const int *values)
{
    return fmi2SetInteger(self, references, count, values);
}

int fmi2SetTime(void *self, double time)
{
    ((instance *)self)->time = time;
    return OK;
}

int fmi2NewDiscreteStates(void *component, struct info *info)
{
    instance *self = component;
    sample(self);
    *info = (struct info){ .terminate = self->time >= self->real[ENDS], .next_defined = 1 };
    info->next = fmin(self->due, self->real[ENDS]);
    return OK;
}

int fmi2CompletedIntegratorStep(void *self, int no_way_back, int *event, int *end)
{
    ((instance *)self)->real[GOES_BACK] += !no_way_back;
    *event = *end = 0;
    return OK;
}

int fmi2SetContinuousStates(void *self, const double *states, size_t count)
{
    (void)count;
    ((instance *)self)->real[X] = states[0];
    return OK;
}

int fmi2GetContinuousStates(void *self, double *states, size_t count)
{
    (void)count;
    states[0] = ((instance *)self)->real[X];
    return OK;
}

int fmi2GetDerivatives(void *self, double *derivatives, size_t count)
{
    (void)count;
    derivatives[0] = ((instance *)self)->real[U];
    return OK;
}

int fmi2GetNominalsOfContinuousStates(void *self, double *nominals, size_t count)
{
    (void)self, (void)count;
    nominals[0] = 1;
    return OK;
}

int fmi2GetFMUstate(void *self, void **state)
{
    *state = calloc(1, sizeof(instance));
    *(instance *)*state = *(instance *)self;
    return OK;
}

int fmi2SetFMUstate(void *self, void *state)
{
    *(instance *)self = *(instance *)state;
    return OK;
}

int fmi2FreeFMUstate(void *self, void **state)
{
    (void)self;
    free(*state);
    *state = NULL;
    return OK;
}

int fmi2EnterEventMode(void *self) { return self == NULL ? ERROR : OK; }
int fmi2EnterContinuousTimeMode(void *self) { return self == NULL ? ERROR : OK; }
int fmi2GetEventIndicators(void *self) { return self == NULL ? ERROR : OK; }
int fmi2SetString(void *self) { return self == NULL ? OK : ERROR; }
int fmi2GetDirectionalDerivative(void *self) { return self == NULL ? OK : ERROR; }
