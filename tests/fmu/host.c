/* A simple master in C: it checks every status, and prints errors only.
 *
 *   host couple HOW STEPS SERIALIZES FMU FMU
 *     couples two FMUs for some steps, saves, restores and resets them, and makes wrong calls. HOW has words
 *     for how the libraries are loaded (now or lazy, global or local) and for the floating-point environment
 *     (traps, upward). Prints the exchanged values at the end, in hexadecimal, to be compared bit by bit.
 *
 *   host cycle CYCLES SERIALIZES KEEP LEAK FMU
 *     loads, runs and unloads a library again and again; with KEEP 1 it stays loaded. Prints before, and
 *     after each quarter of the cycles, the bytes that are allocated and the number of mappings. LEAK bytes
 *     are lost in each cycle; where LEAK is "instance", an instance is.
 *
 * An FMU is four arguments: its library, its GUID, and the value references of the connected outputs and inputs,
 * with commas. SERIALIZES is 1 if the FMUs declare canSerializeFMUstate.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <malloc.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OK = 0, WARNING = 1, ERROR = 3, CO_SIMULATION = 1, MOST = 16 };

typedef void Logger(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger *logger;
    void *(*allocate_memory)(size_t, size_t);
    void (*free_memory)(void *);
    void (*step_finished)(void *, int);
    void *component_environment;
} Callbacks;

/* The functions of the standard that are called, with their results and arguments. */
#define FUNCTIONS(_)                                                                                        \
    _(void *, Instantiate, (const char *, int, const char *, const char *, const Callbacks *, int, int))    \
    _(void, FreeInstance, (void *))                                                                         \
    _(int, SetDebugLogging, (void *, int, size_t, const char *const *))                                     \
    _(int, SetupExperiment, (void *, int, double, double, int, double))                                     \
    _(int, EnterInitializationMode, (void *))                                                               \
    _(int, ExitInitializationMode, (void *))                                                                \
    _(int, Terminate, (void *))                                                                             \
    _(int, Reset, (void *))                                                                                 \
    _(int, GetReal, (void *, const unsigned *, size_t, double *))                                           \
    _(int, SetReal, (void *, const unsigned *, size_t, const double *))                                     \
    _(int, GetFMUstate, (void *, void **))                                                                  \
    _(int, SetFMUstate, (void *, void *))                                                                   \
    _(int, FreeFMUstate, (void *, void **))                                                                 \
    _(int, SerializedFMUstateSize, (void *, void *, size_t *))                                              \
    _(int, SerializeFMUstate, (void *, void *, char *, size_t))                                             \
    _(int, DeSerializeFMUstate, (void *, const char *, size_t, void **))                                    \
    _(int, DoStep, (void *, double, double, int))

#define MEMBER(result, name, arguments) result(*name) arguments;
typedef struct {
    const char *path, *guid;
    unsigned gives[MOST], takes[MOST];
    size_t given, taken;
    double values[MOST];
    void *library, *instance;
    int messages;
    FUNCTIONS(MEMBER)
} Fmu;

static const double STEP = 0.0125;

#define REQUIRE(condition, fmu)                                                                             \
    do {                                                                                                    \
        if (!(condition)) {                                                                                 \
            fprintf(stderr, "%s: line %d: failed: %s\n", (fmu)->path, __LINE__, #condition);                \
            exit(1);                                                                                        \
        }                                                                                                   \
    } while (0)

/* Formats the message, as loggers do, and checks the arguments. */
static void count(void *environment, const char *name, int status, const char *category,
                  const char *message, ...) {
    Fmu *fmu = environment;
    char text[4096];
    va_list arguments;
    va_start(arguments, message);
    int length = vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    REQUIRE(length > 0 && text[length - 1] != '\n', fmu);
    REQUIRE(strcmp(name, "an instance") == 0, fmu);
    REQUIRE(status == ERROR && strcmp(category, "logStatusError") == 0, fmu);
    fmu->messages++;
}

static void load(Fmu *fmu, int flags) {
    fmu->library = dlopen(fmu->path, flags);
    if (!fmu->library) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
#define FIND(result, name, arguments)                                                                       \
    REQUIRE((*(void **)&fmu->name = dlsym(fmu->library, "fmi2" #name)) != NULL, fmu);
    FUNCTIONS(FIND)
}

static void *instantiate(Fmu *fmu, const char *guid) {
    Callbacks callbacks = {count, NULL, NULL, NULL, fmu};
    return fmu->Instantiate("an instance", CO_SIMULATION, guid, NULL, &callbacks, 0, 0);
}

static void get(Fmu *fmu) {
    REQUIRE(fmu->GetReal(fmu->instance, fmu->gives, fmu->given, fmu->values) == OK, fmu);
}

static void set(Fmu *fmu, const Fmu *source) {
    REQUIRE(fmu->SetReal(fmu->instance, fmu->takes, fmu->taken, source->values) == OK, fmu);
}

static void step(Fmu *fmu, int index) {
    REQUIRE(fmu->DoStep(fmu->instance, index * STEP, STEP, 0) == OK, fmu);
}

static void enter(Fmu *fmu) {
    REQUIRE(fmu->SetupExperiment(fmu->instance, 0, 0, 0, 0, 0) == OK, fmu);
    REQUIRE(fmu->EnterInitializationMode(fmu->instance) == OK, fmu);
}

static void leave(Fmu *fmu) { REQUIRE(fmu->ExitInitializationMode(fmu->instance) == OK, fmu); }

/* A state of the instance, serialized and deserialized if the FMU supports it. */
static void *save(Fmu *fmu, int serializes) {
    void *state = NULL;
    size_t size = 0;
    REQUIRE(fmu->GetFMUstate(fmu->instance, &state) == OK && state, fmu);
    if (!serializes) return state;
    /* A variable that was never set may happen to hold the handle of another state. */
    void *copy = state;
    REQUIRE(fmu->SerializedFMUstateSize(fmu->instance, state, &size) == OK && size > 0, fmu);
    char *bytes = malloc(size);
    REQUIRE(fmu->SerializeFMUstate(fmu->instance, state, bytes, size) == OK, fmu);
    REQUIRE(fmu->DeSerializeFMUstate(fmu->instance, bytes, size, &copy) == OK && copy && copy != state, fmu);
    free(bytes);
    REQUIRE(fmu->FreeFMUstate(fmu->instance, &state) == OK && !state, fmu);
    return copy;
}

static void restore(Fmu *fmu, void *state) {
    REQUIRE(fmu->SetFMUstate(fmu->instance, state) == OK, fmu);
    REQUIRE(fmu->FreeFMUstate(fmu->instance, &state) == OK && !state, fmu);
}

/* Wrong calls, each of which must be an error with a message. */
static void provoke(Fmu *fmu) {
    const char *unknown[] = {"no such category"};
    /* The second one traps where it is compared and FE_INVALID is enabled. */
    const union {
        unsigned long long bits;
        double number;
    } quiet = {0x7FF8000000000000}, signaling = {0x7FF0000000000001};
    const unsigned no_variable = 1000000;
    double value;
    int before = fmu->messages;
    REQUIRE(fmu->SetReal(fmu->instance, fmu->takes, 1, &quiet.number) == ERROR, fmu);
    REQUIRE(fmu->SetReal(fmu->instance, fmu->takes, 1, &signaling.number) == ERROR, fmu);
    REQUIRE(fmu->GetReal(fmu->instance, &no_variable, 1, &value) == ERROR, fmu);
    REQUIRE(fmu->DoStep(fmu->instance, 1e3, STEP, 0) == ERROR, fmu);
    REQUIRE(fmu->SetDebugLogging(fmu->instance, 1, 1, unknown) == ERROR, fmu);
    REQUIRE(fmu->EnterInitializationMode(fmu->instance) == ERROR, fmu);
    REQUIRE(fmu->SetFMUstate(fmu->instance, NULL) == ERROR, fmu);
    REQUIRE(instantiate(fmu, "{no GUID}") == NULL, fmu);
    REQUIRE(fmu->messages == before + 8, fmu);
}

/* Both from the start to a number of steps; back once to a state saved halfway. */
static void run(Fmu *first, Fmu *second, int steps, int serializes) {
    enter(first), enter(second);
    for (int exchange = 0; exchange < 2; exchange++) {
        get(first), set(second, first), get(second), set(first, second);
    }
    leave(first), leave(second);
    void *states[2] = {NULL, NULL};
    double reached[2][MOST];
    for (int index = 0, again = 0; index < steps; index++) {
        if (index == steps / 2 && !again) {
            states[0] = save(first, serializes), states[1] = save(second, serializes);
            get(first), get(second);
            memcpy(reached[0], first->values, sizeof first->values);
            memcpy(reached[1], second->values, sizeof second->values);
        }
        get(first), set(second, first), step(second, index);
        get(second), set(first, second), step(first, index);
        if (index == steps - 1 && !again) {
            restore(first, states[0]), restore(second, states[1]);
            get(first), get(second);
            REQUIRE(memcmp(reached[0], first->values, first->given * sizeof(double)) == 0, first);
            REQUIRE(memcmp(reached[1], second->values, second->given * sizeof(double)) == 0, second);
            again = 1, index = steps / 2 - 1;
        }
    }
    get(first), get(second);
}

static int couple(const char *how, int steps, int serializes, Fmu *first, Fmu *second) {
    Fmu *fmus[] = {first, second};
    int flags = strstr(how, "now") ? RTLD_NOW : RTLD_LAZY;
    flags |= strstr(how, "global") ? RTLD_GLOBAL : RTLD_LOCAL;
    /* Hosts in Fortran and Delphi enable traps; others change the rounding. An FMU must not change these settings
    * (section 2.1.1). */
    int traps = strstr(how, "traps") ? FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW : 0;
    int rounding = strstr(how, "upward") ? FE_UPWARD : FE_TONEAREST;
    for (int i = 0; i < 2; i++) {
        load(fmus[i], flags);
        feenableexcept(traps), fesetround(rounding);
        REQUIRE((fmus[i]->instance = instantiate(fmus[i], fmus[i]->guid)) != NULL, fmus[i]);
    }
    run(first, second, steps, serializes);
    for (int i = 0; i < 2; i++) {
        for (size_t k = 0; k < fmus[i]->given; k++) printf("%a\n", fmus[i]->values[k]);
        provoke(fmus[i]);
        REQUIRE(fmus[i]->Reset(fmus[i]->instance) == OK, fmus[i]);
    }
    run(first, second, steps, serializes);
    REQUIRE(fegetexcept() == traps && fegetround() == rounding, first);
    for (int i = 0; i < 2; i++) {
        REQUIRE(fmus[i]->Terminate(fmus[i]->instance) == OK, fmus[i]);
        /* A state that is not freed is freed with its instance (section 2.1.5, fmi2FreeInstance). */
        save(fmus[i], serializes);
        fmus[i]->FreeInstance(fmus[i]->instance);
        REQUIRE(dlclose(fmus[i]->library) == 0, fmus[i]);
    }
    return 0;
}

/* The process's memory. A library that is not loaded has no mapping. */
static void report(const Fmu *fmu, int loaded) {
    char line[8192];
    int lines = 0, found = 0;
    FILE *maps = fopen("/proc/self/maps", "r");
    REQUIRE(maps, fmu);
    while (fgets(line, sizeof line, maps)) lines++, found |= strstr(line, fmu->path) != NULL;
    fclose(maps);
    REQUIRE(found == loaded, fmu);
    struct mallinfo2 heap = mallinfo2();
    printf("%zu %d\n", heap.uordblks + heap.hblkhd, lines);
}

static int cycle(int cycles, int serializes, int keep, const char *leak, Fmu *fmu) {
    volatile char *lost;
    report(fmu, 0);
    for (int index = 1; index <= cycles; index++) {
        if (!keep || index == 1) load(fmu, RTLD_NOW | RTLD_LOCAL);
        REQUIRE((fmu->instance = instantiate(fmu, fmu->guid)) != NULL, fmu);
        enter(fmu), leave(fmu), step(fmu, 0), step(fmu, 1);
        void *state = save(fmu, serializes);
        step(fmu, 2), restore(fmu, state), step(fmu, 2), get(fmu);
        /* As above: freed with the instance. */
        save(fmu, serializes);
        REQUIRE(fmu->GetReal(fmu->instance, NULL, 1, NULL) == ERROR, fmu);
        if (strcmp(leak, "instance") != 0) fmu->FreeInstance(fmu->instance);
        if (atoi(leak)) lost = malloc(atoi(leak)), lost[0] = 1;
        if (!keep) REQUIRE(dlclose(fmu->library) == 0, fmu);
        if (index % (cycles / 4) == 0) report(fmu, keep);
    }
    return 0;
}

static size_t references(char *text, unsigned *found) {
    size_t number = 0;
    for (char *word = strtok(text, ","); word && number < MOST; word = strtok(NULL, ",")) {
        found[number++] = atoi(word);
    }
    return number;
}

static Fmu parse(char **arguments) {
    Fmu fmu = {.path = arguments[0], .guid = arguments[1]};
    fmu.given = references(arguments[2], fmu.gives);
    fmu.taken = references(arguments[3], fmu.takes);
    return fmu;
}

int main(int number, char **arguments) {
    if (number == 13 && strcmp(arguments[1], "couple") == 0) {
        Fmu first = parse(arguments + 5), second = parse(arguments + 9);
        return couple(arguments[2], atoi(arguments[3]), atoi(arguments[4]), &first, &second);
    }
    if (number == 10 && strcmp(arguments[1], "cycle") == 0) {
        Fmu fmu = parse(arguments + 6);
        return cycle(atoi(arguments[2]), atoi(arguments[3]), atoi(arguments[4]), arguments[5], &fmu);
    }
    fprintf(stderr, "usage: see host.c\n");
    return 2;
}
