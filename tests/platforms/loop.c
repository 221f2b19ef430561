/* A master in C that runs on every platform: the controller and the plant, coupled.
 *
 *   loop STEP CONTROLLER PLANT < references
 *
 * An FMU is five arguments: its library, its GUID, and the value references of its connected outputs, its connected
 * inputs and the printed variables, with commas. The controller's first input is the reference, whose value in each
 * step is read from stdin. Prints, for each step, the bits of the printed variables in hexadecimal.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#define NOGDI
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

enum { OK = 0, ERROR = 3, CO_SIMULATION = 1, MOST = 16 };

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate_memory, *free_memory, *step_finished, *component_environment;
} Callbacks;

/* The functions of the standard that are called, with their results and arguments. */
#define FUNCTIONS(_)                                                                                        \
    _(void *, Instantiate, (const char *, int, const char *, const char *, const Callbacks *, int, int))    \
    _(void, FreeInstance, (void *))                                                                         \
    _(int, SetupExperiment, (void *, int, double, double, int, double))                                     \
    _(int, EnterInitializationMode, (void *))                                                               \
    _(int, ExitInitializationMode, (void *))                                                                \
    _(int, GetReal, (void *, const unsigned *, size_t, double *))                                           \
    _(int, SetReal, (void *, const unsigned *, size_t, const double *))                                     \
    _(int, DoStep, (void *, double, double, int))                                                           \
    _(int, Terminate, (void *))

#define MEMBER(result, name, arguments) result(*name) arguments;
typedef struct {
    const char *path;
    unsigned gives[MOST], takes[MOST], prints[MOST];
    size_t given, taken, printed;
    void *instance;
    int messages;
    FUNCTIONS(MEMBER)
} Fmu;

static void require(int condition, const char *path, const char *what) {
    if (!condition) {
        fprintf(stderr, "%s: %s failed\n", path, what);
        exit(1);
    }
}
#define REQUIRE(fmu, call) require((call) == OK, (fmu)->path, #call)

static void count(void *environment, const char *name, int status, const char *category,
                  const char *message, ...) {
    (void)name, (void)category, (void)message;
    if (status == ERROR) ++*(int *)environment;
}

static size_t references(char *text, unsigned *found) {
    size_t number = 0;
    for (char *word = strtok(text, ","); word && number < MOST; word = strtok(NULL, ",")) {
        found[number++] = (unsigned)atoi(word);
    }
    return number;
}

static void start(Fmu *fmu, char **arguments) {
    fmu->path = arguments[0];
    fmu->given = references(arguments[2], fmu->gives);
    fmu->taken = references(arguments[3], fmu->takes);
    fmu->printed = references(arguments[4], fmu->prints);
    void *library = OPEN(fmu->path);
    require(library != NULL, fmu->path, "loading it");
#define LOAD(result, name, arguments)                                                                       \
    *(void **)&fmu->name = FIND(library, "fmi2" #name);                                                     \
    require(fmu->name != NULL, fmu->path, "finding fmi2" #name);
    FUNCTIONS(LOAD)
    Callbacks callbacks = {count, NULL, NULL, NULL, &fmu->messages};
    fmu->instance = fmu->Instantiate("loop", CO_SIMULATION, arguments[1], NULL, &callbacks, 0, 0);
    require(fmu->instance != NULL, fmu->path, "fmi2Instantiate");
    REQUIRE(fmu, fmu->SetupExperiment(fmu->instance, 0, 0, 0, 0, 0));
    REQUIRE(fmu, fmu->EnterInitializationMode(fmu->instance));
}

/* Passes outputs to the other's inputs, from the index `first` on. */
static void transfer(Fmu *source, Fmu *target, size_t first) {
    double values[MOST];
    REQUIRE(source, source->GetReal(source->instance, source->gives, source->given, values));
    REQUIRE(target, target->SetReal(target->instance, target->takes + first, source->given, values));
}

static void print(Fmu *fmu) {
    double values[MOST];
    unsigned long long bits;
    REQUIRE(fmu, fmu->GetReal(fmu->instance, fmu->prints, fmu->printed, values));
    for (size_t index = 0; index < fmu->printed; index++) {
        memcpy(&bits, &values[index], sizeof bits);
        printf(" %016llx", bits);
    }
}

int main(int number, char **arguments) {
    Fmu controller = {0}, plant = {0};
    double reference;
    if (number != 12) {
        fprintf(stderr, "usage: see loop.c\n");
        return 2;
    }
    double step = atof(arguments[1]);
    start(&controller, arguments + 2);
    start(&plant, arguments + 7);
    for (int index = 0; scanf("%lf", &reference) == 1; index++) {
        REQUIRE(&controller, controller.SetReal(controller.instance, controller.takes, 1, &reference));
        if (index == 0) {
            for (int exchange = 0; exchange < 2; exchange++) {
                transfer(&controller, &plant, 0), transfer(&plant, &controller, 1);
            }
            REQUIRE(&controller, controller.ExitInitializationMode(controller.instance));
            REQUIRE(&plant, plant.ExitInitializationMode(plant.instance));
        }
        transfer(&plant, &controller, 1);
        REQUIRE(&controller, controller.DoStep(controller.instance, index * step, step, 0));
        transfer(&controller, &plant, 0);
        REQUIRE(&plant, plant.DoStep(plant.instance, index * step, step, 0));
        print(&controller), print(&plant), printf("\n");
    }
    /* An error is logged, and the process continues. */
    require(controller.messages == 0 && plant.messages == 0, "both", "going on without errors");
    require(plant.DoStep(plant.instance, 0, -step, 0) == ERROR && plant.messages == 1, plant.path, "refusing");
    REQUIRE(&controller, controller.Terminate(controller.instance));
    controller.FreeInstance(controller.instance), plant.FreeInstance(plant.instance);
    return 0;
}
