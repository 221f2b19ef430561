/* A careless FMU: it keeps the pointer to the callbacks, lets the importer format its messages, and fails on
* request. It integrates its input. */

#include <stdlib.h>
#include <string.h>

typedef int fmi2Status;
typedef void (*logger)(void *, const char *, fmi2Status, const char *, const char *, ...);
typedef struct {
    logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} callbacks;

enum { LEVEL = 0, INPUT = 1, FAIL = 2, STATES = 3, FLAG = 4, NOTE = 5 };
enum { NO, DISCARD, ERROR, NO_STATUS, FATAL };

typedef struct {
    const callbacks *functions;
    const char *name;
    double level, input, time;
    int fail, states, flag;
} instance;

typedef struct {
    double level, time;
} state;

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const callbacks *functions, int visible, int logging)
{
    (void)type, (void)resources, (void)visible, (void)logging;
    if (strcmp(guid, "careless") != 0) {
        functions->log(functions->environment, name, 3, "error", "%s is not %d%% mine", guid, 100);
        return NULL;
    }
    instance *self = functions->allocate(1, sizeof *self);
    self->functions = functions;
    self->name = name;
    self->input = 1;
    return self;
}

void fmi2FreeInstance(void *component)
{
    instance *self = component;
    /* Detects states that were not freed, and calls after a fatal error. */
    if (self->states != 0 || self->fail == FATAL)
        abort();
    self->functions->release(self);
}

fmi2Status fmi2SetupExperiment(void *component, int a, double b, double start, int c, double d)
{
    (void)a, (void)b, (void)c, (void)d;
    ((instance *)component)->time = start;
    return 0;
}

fmi2Status fmi2EnterInitializationMode(void *component) { return component == NULL ? 3 : 0; }
fmi2Status fmi2ExitInitializationMode(void *component) { return component == NULL ? 3 : 0; }
fmi2Status fmi2Terminate(void *component) { return component == NULL ? 3 : 0; }

fmi2Status fmi2DoStep(void *component, double time, double size, int no_way_back)
{
    (void)no_way_back;
    instance *self = component;
    const callbacks *functions = self->functions;
    switch (self->fail) {
    case DISCARD:
        self->time = time + size / 2;
        functions->log(functions->environment, self->name, 2, "solver", "%s at %g s: level %g, #r0#", "stiff", time,
                       self->level);
        return 2;
    case ERROR:
        functions->log(functions->environment, self->name, 3, NULL, "no way, ## %d", 7);
        return 3;
    case NO_STATUS:
        return 17;
    case FATAL:
        return 4;
    }
    functions->log(functions->environment, self->name, 0, "info", "a step");
    self->level += size * self->input;
    self->time = time + size;
    return 0;
}

fmi2Status fmi2GetReal(void *component, const unsigned *references, size_t count, double *values)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++)
        values[i] = references[i] == LEVEL ? self->level : self->input;
    return 0;
}

fmi2Status fmi2SetReal(void *component, const unsigned *references, size_t count, const double *values)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++)
        *(references[i] == LEVEL ? &self->level : &self->input) = values[i];
    return 0;
}

fmi2Status fmi2GetInteger(void *component, const unsigned *references, size_t count, int *values)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++)
        values[i] = references[i] == FAIL ? self->fail : self->states;
    return 0;
}

fmi2Status fmi2SetInteger(void *component, const unsigned *references, size_t count, const int *values)
{
    (void)references;
    if (count == 1)
        ((instance *)component)->fail = values[0];
    return 0;
}

fmi2Status fmi2GetBoolean(void *component, const unsigned *references, size_t count, int *values)
{
    (void)references;
    for (size_t i = 0; i < count; i++)
        values[i] = ((instance *)component)->flag;
    return 0;
}

fmi2Status fmi2SetBoolean(void *component, const unsigned *references, size_t count, const int *values)
{
    (void)references;
    for (size_t i = 0; i < count; i++)
        ((instance *)component)->flag = values[i];
    return 0;
}

/* Accepts this text in UTF-8 only. */
fmi2Status fmi2SetString(void *component, const unsigned *references, size_t count, const char *const *values)
{
    (void)component;
    return count == 1 && references[0] == NOTE && strcmp(values[0], "Gr\xc3\xb6\xc3\x9f" "e") == 0 ? 0 : 3;
}

/* A text that changes with the level, and is none above 1. */
fmi2Status fmi2GetString(void *component, const unsigned *references, size_t count, const char **values)
{
    double level = ((instance *)component)->level;
    (void)references;
    for (size_t i = 0; i < count; i++)
        values[i] = level > 1 ? NULL : level > 0.5 ? "\"up\", nearly" : "low";
    return 0;
}

fmi2Status fmi2GetFMUstate(void *component, void **saved)
{
    instance *self = component;
    state *copy = malloc(sizeof *copy);
    copy->level = self->level;
    copy->time = self->time;
    self->states++;
    *saved = copy;
    return 0;
}

fmi2Status fmi2SetFMUstate(void *component, void *saved)
{
    instance *self = component;
    self->level = ((state *)saved)->level;
    self->time = ((state *)saved)->time;
    return 0;
}

fmi2Status fmi2FreeFMUstate(void *component, void **saved)
{
    ((instance *)component)->states--;
    free(*saved);
    *saved = NULL;
    return 0;
}

fmi2Status fmi2GetRealStatus(void *component, int kind, double *value)
{
    if (kind != 2)
        return 3;
    *value = ((instance *)component)->time;
    return 0;
}
