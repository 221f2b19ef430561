/* A careless FMU of FMI 3.0: it forgets the environment of its messages' receiver if asked to, writes any number into a
 * Boolean, asks for the end, and fails on request. It integrates its input. */

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef int fmi3Status;
typedef void (*logger)(void *, fmi3Status, const char *, const char *);

enum { LEVEL = 0, INPUT = 1, FAIL = 2, COUNT = 3, FLAG = 4, NOTE = 5, TABLE = 6, SMALL = 7, STOP = 8 };
enum { NO, DISCARD, ERROR, FATAL };

typedef struct {
    logger log;
    void *environment;
    double level, input, table[6], stop;
    float small;
    int64_t fail, count;
    uint8_t flag;
} instance;

/* Everything that is not below. */
#define REFUSED(name)                                                                                                  \
    fmi3Status fmi3##name(void) { return 3; }
REFUSED(GetInt8) REFUSED(SetInt8) REFUSED(GetUInt8) REFUSED(SetUInt8) REFUSED(GetInt16) REFUSED(SetInt16)
REFUSED(GetUInt16) REFUSED(SetUInt16) REFUSED(GetInt32) REFUSED(SetInt32) REFUSED(GetUInt32) REFUSED(SetUInt32)
REFUSED(GetUInt64) REFUSED(SetUInt64)

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const uint32_t *required, size_t count, void *environment,
                                  logger log, void *update)
{
    (void)name, (void)required;
    size_t length = strlen(resources);
    if (strcmp(token, "careless") != 0 || visible || !logging || events || early || count != 0 || update != NULL ||
        resources[0] != '/' || resources[length - 1] != '/') {
        log(environment, 3, "error", "100% not mine");
        return NULL;
    }
    instance *self = calloc(1, sizeof *self);
    self->log = log;
    self->environment = environment;
    self->input = 1;
    self->stop = 1e9;
    return self;
}

void fmi3FreeInstance(void *component)
{
    /* Detects states that were not freed, and calls after a fatal error. */
    if (((instance *)component)->count != 0 || ((instance *)component)->fail == FATAL)
        abort();
    free(component);
}

fmi3Status fmi3EnterInitializationMode(void *component, bool a, double b, double start, bool has_stop, double stop)
{
    (void)a, (void)b;
    /* The experiment of the tests. */
    ((instance *)component)->level = start;
    return has_stop && stop == 3 ? 3 : 0;
}

fmi3Status fmi3ExitInitializationMode(void *component) { return component == NULL ? 3 : 0; }
fmi3Status fmi3Terminate(void *component) { return component == NULL ? 3 : 0; }

fmi3Status fmi3DoStep(void *component, double time, double size, bool a, bool *event, bool *terminate, bool *early,
                      double *reached)
{
    (void)a;
    instance *self = component;
    *event = *early = false;
    *terminate = time + size >= self->stop;
    *reached = *terminate ? self->stop : time + size;
    switch (self->fail) {
    case DISCARD:
        *reached = time + size / 2;
        self->log(self->environment, 2, NULL, "stiff: #0#, 100%, ##7, #6#");
        return 2;
    case ERROR:
        self->log(NULL, 3, NULL, "somebody hears this");
        return 3;
    case FATAL:
        return 4;
    }
    self->level += size * self->input;
    return 0;
}

fmi3Status fmi3GetFloat64(void *component, const uint32_t *references, size_t count, double *values, size_t size)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++) {
        if (references[i] == TABLE) {
            memcpy(values, self->table, sizeof self->table);
            values += 6, size -= 6;
        } else {
            *values++ = references[i] == LEVEL ? self->level : references[i] == STOP ? self->stop : self->input;
            size--;
        }
    }
    return size == 0 ? 0 : 3;
}

fmi3Status fmi3SetFloat64(void *component, const uint32_t *references, size_t count, const double *values, size_t size)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++) {
        if (references[i] == TABLE) {
            memcpy(self->table, values, sizeof self->table);
            values += 6, size -= 6;
        } else {
            *(references[i] == LEVEL ? &self->level : references[i] == STOP ? &self->stop : &self->input) = *values++;
            size--;
        }
    }
    return size == 0 ? 0 : 3;
}

fmi3Status fmi3GetFloat32(void *component, const uint32_t *references, size_t count, float *values, size_t size)
{
    *values = ((instance *)component)->small;
    return count == 1 && size == 1 && references[0] == SMALL ? 0 : 3;
}

fmi3Status fmi3SetFloat32(void *component, const uint32_t *references, size_t count, const float *values, size_t size)
{
    ((instance *)component)->small = *values;
    return count == 1 && size == 1 && references[0] == SMALL ? 0 : 3;
}

fmi3Status fmi3GetInt64(void *component, const uint32_t *references, size_t count, int64_t *values, size_t size)
{
    instance *self = component;
    for (size_t i = 0; i < count; i++)
        values[i] = references[i] == FAIL ? self->fail : self->count;
    return size == count ? 0 : 3;
}

fmi3Status fmi3SetInt64(void *component, const uint32_t *references, size_t count, const int64_t *values, size_t size)
{
    if (count != 1 || size != 1 || references[0] != FAIL)
        return 3;
    ((instance *)component)->fail = values[0];
    return 0;
}

fmi3Status fmi3GetBoolean(void *component, const uint32_t *references, size_t count, uint8_t *values, size_t size)
{
    *values = ((instance *)component)->flag;
    return count == 1 && size == 1 && references[0] == FLAG ? 0 : 3;
}

/* True is 77. */
fmi3Status fmi3SetBoolean(void *component, const uint32_t *references, size_t count, const uint8_t *values, size_t size)
{
    ((instance *)component)->flag = 77 * *values;
    return count == 1 && size == 1 && references[0] == FLAG ? 0 : 3;
}

/* Accepts this text in UTF-8 only. */
fmi3Status fmi3SetString(void *component, const uint32_t *references, size_t count, const char *const *values, size_t size)
{
    (void)component;
    return count == 1 && size == 1 && references[0] == NOTE && strcmp(values[0], "Gr\xc3\xb6\xc3\x9f" "e") == 0 ? 0 : 3;
}

fmi3Status fmi3GetFMUState(void *component, void **saved)
{
    instance *self = component;
    self->count++;
    *saved = malloc(sizeof *self);
    memcpy(*saved, self, sizeof *self);
    return 0;
}

fmi3Status fmi3SetFMUState(void *component, void *saved)
{
    ((instance *)component)->level = ((instance *)saved)->level;
    return 0;
}

fmi3Status fmi3FreeFMUState(void *component, void **saved)
{
    ((instance *)component)->count--;
    free(*saved);
    *saved = NULL;
    return 0;
}
