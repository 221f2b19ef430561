/* Runs the model Van der Pol, linked to this program, and prints the bits of its states: two instances in turn, a state that
 * is saved and restored, and calls that are refused, with their messages.
 *
 *   sources GUID
 */
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate_memory, *free_memory, *step_finished, *component_environment;
} Callbacks;

void *fmi2Instantiate(const char *, int, const char *, const char *, const Callbacks *, int, int);
void fmi2FreeInstance(void *);
int fmi2SetupExperiment(void *, int, double, double, int, double);
int fmi2EnterInitializationMode(void *);
int fmi2ExitInitializationMode(void *);
int fmi2Reset(void *);
int fmi2GetReal(void *, const unsigned *, size_t, double *);
int fmi2DoStep(void *, double, double, int);
int fmi2GetFMUstate(void *, void **);
int fmi2SetFMUstate(void *, void *);
int fmi2FreeFMUstate(void *, void **);

static void require(int condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "%s failed\n", what);
        exit(1);
    }
}
#define REQUIRE(condition) require(condition, #condition)

static void print_message(void *environment, const char *name, int status, const char *category, const char *format, ...) {
    (void)environment;
    (void)format;
    printf("%s %d %s\n", name, status, category);
}

static void print_values(void *instance) {
    static const unsigned references[] = {1, 3};
    double values[2];
    uint64_t bits[2];
    REQUIRE(fmi2GetReal(instance, references, 2, values) == 0);
    memcpy(bits, values, sizeof bits);
    printf("%016" PRIx64 " %016" PRIx64 "\n", bits[0], bits[1]);
}

static void start(void *instance) {
    REQUIRE(fmi2SetupExperiment(instance, 0, 0, 0, 0, 0) == 0);
    REQUIRE(fmi2EnterInitializationMode(instance) == 0);
    REQUIRE(fmi2ExitInitializationMode(instance) == 0);
}

int main(int count, char **arguments) {
    const Callbacks callbacks = {print_message, NULL, NULL, NULL, NULL};
    void *instances[2], *state = NULL;
    int step, which;
    REQUIRE(count == 2);
    REQUIRE(fmi2Instantiate("wrong", 1, "another", NULL, &callbacks, 0, 0) == NULL);
    for (which = 0; which < 2; which++) {
        instances[which] = fmi2Instantiate(which ? "second" : "first", 1, arguments[1], NULL, &callbacks, 0, 0);
        REQUIRE(instances[which] != NULL);
        start(instances[which]);
    }
    for (step = 0; step < 200; step++) {
        for (which = 0; which < 2; which++) {
            REQUIRE(fmi2DoStep(instances[which], step * 0.05, 0.05, 1) == 0);
            print_values(instances[which]);
        }
        if (step == 100) REQUIRE(fmi2GetFMUstate(instances[0], &state) == 0);
    }
    REQUIRE(fmi2DoStep(instances[0], 0, 0.05, 1) == 3);
    REQUIRE(fmi2SetFMUstate(instances[0], (void *)instances) == 3);
    REQUIRE(fmi2SetFMUstate(instances[1], state) == 0);
    print_values(instances[1]);
    REQUIRE(fmi2DoStep(instances[1], 101 * 0.05, 0.05, 1) == 0);
    print_values(instances[1]);
    REQUIRE(fmi2FreeFMUstate(instances[1], &state) == 0 && state == NULL);
    REQUIRE(fmi2Reset(instances[0]) == 0);
    start(instances[0]);
    print_values(instances[0]);
    for (which = 0; which < 2; which++) fmi2FreeInstance(instances[which]);
    return 0;
}
