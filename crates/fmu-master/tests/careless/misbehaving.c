/* An FMU that misbehaves as the parameter `misdeed` tells it, of FMI 2.0 and 3.0, for co-simulation and Model Exchange. The GUID
 * is the number of its first misdeed, which may be one of the instantiation; the variable MISDEED of the environment is that of
 * one of the loading, IN_STEP that of a step that asks for it. Its states follow one of several `system`s. */

#define _GNU_SOURCE
#include <dirent.h>
#include <fcntl.h>
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

enum { OK = 0, WARNING = 1, ERROR = 3 };

/* In the order of the enumeration `Misdeed` in mod.rs. */
enum misdeed {
    NONE,
    /* An end of the process. */
    EXIT_IN_LOAD, EXIT_IN_INSTANTIATE, EXIT_IN_STEP, EXIT_IN_THREAD, EXIT_IN_TERMINATE, EXIT_IN_FREE, QUICK_EXIT_IN_STEP,
    FAIL_IN_STEP,
    /* Messages with another environment, at another time, or without their parts. */
    LOG_ONE, LOG_NULL, LOG_OWN, LOG_IN_INSTANTIATE, LOG_IN_THREAD, LOG_IN_FREE, LOG_AFTER_FREE, LOG_NOTHING, LOG_LATIN,
    LOG_UNKNOWN_STATUS, LOG_OTHER,
    /* Wrong directional derivatives by the state `column`, from the time `from` on. */
    HUGE_DERIVATIVE, OPPOSITE_DERIVATIVE, NO_DERIVATIVE, NAN_DERIVATIVE,
    /* `y` is not a number from the time `from` on; half a step of FMI 3.0. */
    NAN_OUTPUT, HALF_STEP,
    /* In a step. Another end of the process, or none. */
    END, ABORT, DEREFERENCE_NULL, HANG,
    /* What is left to others: the rounding mode, traps, a handler, the working folder, standard output. */
    ROUND_UP, TRAP, HANDLE, LEAVE_FOLDER, PRINT, CLOSE_OUTPUT,
    /* Waits for another process that does so, by files in the folder MEETING of the environment. */
    MEET,
    /* What the environment says. */
    TOLD,
    /* An event of FMI 3.0: at the time `from`, within a step, or at the begin of each step. */
    EVENT_IN_STEP, EVENT_FOR_EVER,
    /* An end of the process in the initialization, and when the library is unloaded. */
    ABORT_IN_INITIALIZATION, ABORT_IN_UNLOAD,
    /* In the first step. A second process, which goes on as the first; one that stays, in a session of its own, or as it is.
     * The environment's CHILD is a file for the numbers of these. */
    FORK, LEAVE_CHILD, LEAVE_SESSION,
    /* In a step. Writes to any descriptor, or closes it. */
    WRITE_ANYWHERE, CLOSE_ANY,
    /* What else is left to others. */
    MASK_MODES, SET_LOCALE, SET_ENVIRONMENT, LIMIT, BLOCK_SIGNALS, LEAK, ALARM,
    /* At the end of a run, and of the process. */
    FAIL_IN_TERMINATE, ABORT_AT_EXIT,
};

/* In the order of the enumeration `System` in mod.rs. */
enum system { LAGS, STIFF, SCALED, ROBERTSON, VAN_DER_POL, KINK, ROUNDED, NOISY, DIODE };

/* References: those of states are below those of derivatives. */
enum { DERIVATIVES = 100, STATUS = 200, COLUMN, FROM, EVENT, MISDEED, SYSTEM, Y, THIRD, INSTANCES };
enum { MOST_STATES = 50 };

typedef void logger2(void *, const char *, int, const char *, const char *, ...);
typedef void logger3(void *, int, const char *, const char *);
typedef struct {
    logger2 *log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} callbacks;

struct info {
    int needed, terminate, nominals, values_changed, next_defined;
    double next;
};

typedef struct {
    const callbacks *functions;
    logger3 *log3;
    void *environment;
    double time, column, from, event, status, states[MOST_STATES];
    int64_t misdeed, system;
    size_t count;
    bool reports_events, may_return_early, has_event;
} instance;

static void say(const instance *self, void *environment, int status, const char *category, const char *text)
{
    if (self->log3 != NULL)
        self->log3(environment, status, category, text);
    else
        self->functions->log(environment, "misbehaving", status, category, text);
}

static void *own_environment(const instance *self)
{
    return self->log3 != NULL ? self->environment : self->functions->environment;
}

static instance late;
/* The last instance made, and how many there were. */
static const instance *newest;
static double instances;

/* Once its instances are freed, when the library is unloaded. */
__attribute__((destructor)) static void unload(void)
{
    if (late.misdeed == LOG_AFTER_FREE)
        say(&late, own_environment(&late), WARNING, "late", "said after the end");
    if (late.misdeed == ABORT_IN_UNLOAD)
        abort();
}

__attribute__((constructor)) static void load(void)
{
    const char *misdeed = getenv("MISDEED");
    if (misdeed != NULL && atoi(misdeed) == EXIT_IN_LOAD)
        exit(0);
}

static void *misbehave_in_thread(void *argument)
{
    const instance *self = argument;
    if (self->misdeed == EXIT_IN_THREAD)
        exit(0);
    int anything;
    say(self, &anything, WARNING, "thread", "said in a thread");
    return NULL;
}

static void *instantiate(const char *guid, const callbacks *functions, logger3 *log3, void *environment)
{
    instance *self = calloc(1, sizeof *self);
    newest = self;
    instances++;
    self->misdeed = (enum misdeed)atoi(guid);
    self->functions = functions;
    self->log3 = log3;
    self->environment = environment;
    if (self->misdeed == EXIT_IN_INSTANTIATE)
        exit(0);
    if (self->misdeed == LOG_IN_INSTANTIATE)
        say(self, (void *)1, WARNING, "start", "said at the start");
    for (int i = 0; i < MOST_STATES; i++)
        self->states[i] = i == 0;
    return self;
}

static void meet(void)
{
    char file[4096];
    snprintf(file, sizeof file, "%s/%ld", getenv("MEETING"), (long)getpid());
    close(open(file, O_CREAT | O_WRONLY, 0600));
    int here = 0;
    while (here < 2) {
        here = 0;
        DIR *meeting = opendir(getenv("MEETING"));
        for (struct dirent *entry = readdir(meeting); entry != NULL; entry = readdir(meeting))
            here += entry->d_name[0] != '.';
        closedir(meeting);
        usleep(1000);
    }
}

/* A process that stays. */
static void leave(bool in_own_session)
{
    pid_t child = fork();
    if (child == 0) {
        if (in_own_session)
            setsid();
        for (;;)
            pause();
    }
    FILE *file = fopen(getenv("CHILD"), "a");
    fprintf(file, "%ld\n", (long)child);
    fclose(file);
}

#ifdef __GLIBC__
static void fail_at_exit(int status, void *argument)
{
    (void)status, (void)argument;
    abort();
}
#endif

static int step(instance *self, double time, double size)
{
    if (self->misdeed == TOLD)
        self->misdeed = (enum misdeed)atoi(getenv("IN_STEP"));
    void *own = own_environment(self);
    int here;
    switch (self->misdeed) {
    case EXIT_IN_STEP:
        if (time >= self->from)
            exit((int)self->status);
        break;
    case QUICK_EXIT_IN_STEP:
        quick_exit((int)self->status);
    case FAIL_IN_STEP:
        say(self, &here, ERROR, "step", "it cannot go on");
        return ERROR;
    case EXIT_IN_THREAD:
    case LOG_IN_THREAD: {
        pthread_t thread;
        pthread_create(&thread, NULL, misbehave_in_thread, self);
        pthread_join(thread, NULL);
        break;
    }
    case LOG_ONE:
        say(self, (void *)1, WARNING, "step", "said with 1");
        break;
    case LOG_NULL:
        say(self, NULL, WARNING, "step", "said with null");
        break;
    case LOG_OWN:
        say(self, self, WARNING, "step", "said with its own");
        break;
    case LOG_NOTHING:
        say(self, own, WARNING, NULL, NULL);
        break;
    case LOG_LATIN:
        say(self, own, WARNING, "\xe9", "d\xe9j\xe0 vu");
        break;
    case LOG_OTHER:
        say(self, own_environment(newest), WARNING, "step", "said with another's");
        break;
    case LOG_UNKNOWN_STATUS:
        say(self, &here, 17, "step", "said with 17");
        return ERROR;
    case END:
        _exit((int)self->status);
    case ABORT:
        abort();
    case DEREFERENCE_NULL:
        *(volatile int *)NULL = 0;
        break;
    case HANG:
        puts("it hangs");
        fflush(stdout);
        for (;;)
            pause();
    case ROUND_UP:
        fesetround(FE_UPWARD);
        break;
    case TRAP:
#ifdef __GLIBC__
        feenableexcept(FE_DIVBYZERO | FE_INEXACT);
#endif
        break;
    case HANDLE:
        signal(SIGUSR1, SIG_IGN);
        break;
    case LEAVE_FOLDER:
        if (chdir("/") != 0)
            return ERROR;
        break;
    case PRINT:
        puts("{\"Done\":{\"result\":{\"run\":0,\"error\":null,\"measures\":[7,7],\"warnings\":[]},\"is_clean\":true}}");
        fflush(stdout);
        break;
    case CLOSE_OUTPUT:
        fclose(stdout);
        break;
    case MEET:
        meet();
        break;
    case FORK:
        if (time == 0)
            fork();
        break;
    case LEAVE_CHILD:
    case LEAVE_SESSION:
        if (time == 0)
            leave(self->misdeed == LEAVE_SESSION);
        break;
    case WRITE_ANYWHERE:
        for (int i = 3; i < 40; i++)
            if (write(i, "x", 1) < 0)
                continue;
        break;
    case CLOSE_ANY:
        for (int i = 3; i < 64; i++)
            close(i);
        break;
    case MASK_MODES:
        umask(0777);
        break;
    case SET_LOCALE:
        if (setlocale(LC_ALL, "C.UTF-8") == NULL)
            return ERROR;
        break;
    case SET_ENVIRONMENT:
        setenv("SET_BY_THE_FMU", "1", 1);
        break;
    case LIMIT: {
        struct rlimit limit;
        getrlimit(RLIMIT_NOFILE, &limit);
        limit.rlim_cur--;
        setrlimit(RLIMIT_NOFILE, &limit);
        break;
    }
    case BLOCK_SIGNALS: {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, NULL);
        break;
    }
    case LEAK:
        if (open("/dev/null", O_RDONLY) < 0)
            return ERROR;
        break;
    case ALARM:
        alarm(1000);
        break;
    case ABORT_AT_EXIT:
#ifdef __GLIBC__
        on_exit(fail_at_exit, NULL);
#endif
        break;
    }
    self->time = time + size;
    return OK;
}

static int terminate(instance *self)
{
    if (self->misdeed == EXIT_IN_TERMINATE)
        exit(0);
    return self->misdeed == FAIL_IN_TERMINATE ? ERROR : OK;
}

static void release(instance *self)
{
    if (self->misdeed == EXIT_IN_FREE)
        exit(0);
    if (self->misdeed == LOG_IN_FREE)
        say(self, (void *)1, WARNING, "end", "said at the end");
    if (self->misdeed == LOG_AFTER_FREE || self->misdeed == ABORT_IN_UNLOAD)
        late = *self;
    free(self);
}

/* By what a state of the system SCALED is measured. */
static double scale(size_t state)
{
    return state % 2 == 0 ? 1e-9 : 1e9;
}

static void reset(instance *self)
{
    double *x = self->states;
    if (self->misdeed == ABORT_IN_INITIALIZATION)
        abort();
    memset(x, 0, sizeof self->states);
    switch (self->system) {
    case SCALED:
        for (size_t i = 0; i < MOST_STATES; i++)
            x[i] = scale(i);
        break;
    case VAN_DER_POL:
        x[0] = 2;
        break;
    case KINK:
        break;
    default:
        x[0] = 1;
    }
}

/* Multiplies the Jacobian and a direction, in place of which NULL asks for the derivatives. */
static void differentiate(const instance *self, const double *v, double *out)
{
    const double *x = self->states;
    size_t count = self->count;
    double noise;
    switch (self->system) {
    case LAGS: /* x1' = -x1, and each other follows the one before. */
        for (size_t i = 0; i < count; i++) {
            const double *of = v == NULL ? x : v;
            out[i] = (i > 0 ? of[i - 1] : 0) - of[i];
        }
        break;
    case STIFF: /* One of 1e12 1/s, and one that follows it. */
        out[0] = v == NULL ? -1e12 * (x[0] - cos(self->time)) : -1e12 * v[0];
        out[1] = v == NULL ? x[0] - x[1] : v[0] - v[1];
        break;
    case SCALED: /* LAGS in other units. */
        for (size_t i = 0; i < count; i++) {
            const double *of = v == NULL ? x : v;
            out[i] = (i > 0 ? scale(i) / scale(i - 1) * of[i - 1] : 0) - of[i];
        }
        break;
    case ROBERTSON: /* Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.1, (1.4) */
        if (v == NULL) {
            out[0] = -0.04 * x[0] + 1e4 * x[1] * x[2];
            out[2] = 3e7 * x[1] * x[1];
        } else {
            out[0] = -0.04 * v[0] + 1e4 * (x[1] * v[2] + v[1] * x[2]);
            out[2] = 6e7 * x[1] * v[1];
        }
        out[1] = -out[0] - out[2];
        break;
    case VAN_DER_POL: /* Its parameter is 1000. */
        out[0] = v == NULL ? x[1] : v[1];
        out[1] = v == NULL ? 1e3 * (1 - x[0] * x[0]) * x[1] - x[0]
                           : 1e3 * ((1 - x[0] * x[0]) * v[1] - 2 * x[0] * v[0] * x[1]) - v[0];
        break;
    case KINK: /* It starts at the kink. */
        out[0] = v == NULL ? 1 - fmax(0, x[0]) : x[0] > 0 ? -v[0] : 0;
        break;
    case ROUNDED: /* Its terms cancel: the state enters by multiples of 2e-6. */
        out[0] = v == NULL ? 1e10 - (x[0] + 1e10) : -v[0];
        break;
    case NOISY: /* As with equations that are solved to 1e-9. */
        noise = x[0] * 1e12 - floor(x[0] * 1e12);
        out[0] = v == NULL ? -x[0] * (1 + 1e-9 * noise) : -v[0];
        break;
    case DIODE: /* A capacitor that is charged through 1 kOhm, and a diode. */
        out[0] = v == NULL ? 1e6 * ((5 - x[0]) * 1e-3 - 1e-14 * (exp(x[0] / 0.025) - 1))
                           : -1e6 * (1e-3 + 1e-14 / 0.025 * exp(x[0] / 0.025)) * v[0];
        break;
    }
}

/* The time of the next event, at which the first state jumps to 1, if there is one. */
static double update(instance *self)
{
    if (self->event > 0 && self->time >= self->event)
        self->states[0] = 1;
    return self->time < self->event ? self->event : NAN;
}

/* The event of a step lets the first state jump to 7. */
static void handle(instance *self)
{
    if (self->has_event)
        self->states[0] = 7;
    self->has_event = false;
}

static void direct(const instance *self, const double *seed, double *out)
{
    double direction[MOST_STATES];
    size_t column = (size_t)self->column;
    bool is_wrong = self->time >= self->from;
    memcpy(direction, seed, self->count * sizeof *seed);
    if (is_wrong && self->misdeed == OPPOSITE_DERIVATIVE)
        direction[column] *= -1;
    if (is_wrong && self->misdeed == NO_DERIVATIVE)
        direction[column] = 0;
    differentiate(self, direction, out);
    if (is_wrong && direction[column] != 0 && self->misdeed == HUGE_DERIVATIVE)
        out[column] = 1e9 * direction[column];
    if (is_wrong && direction[column] != 0 && self->misdeed == NAN_DERIVATIVE)
        out[column] = NAN;
}

static double *real(instance *self, unsigned reference)
{
    static double derivatives[MOST_STATES], third;
    volatile double one = 1;
    switch (reference) {
    case STATUS:
        return &self->status;
    case COLUMN:
        return &self->column;
    case FROM:
        return &self->from;
    case EVENT:
        return &self->event;
    case Y:
        return &self->time;
    case THIRD:
        third = one / 3;
        return &third;
    case INSTANCES:
        return &instances;
    }
    if (reference < DERIVATIVES)
        return &self->states[reference];
    differentiate(self, NULL, derivatives);
    return &derivatives[reference - DERIVATIVES];
}

static int64_t *whole(instance *self, unsigned reference)
{
    return reference == SYSTEM ? &self->system : &self->misdeed;
}

/* Of both versions, for co-simulation and Model Exchange. */
#define COMMON(prefix, state)                                                                                          \
    void prefix##FreeInstance(void *self) { release(self); }                                                           \
    int prefix##ExitInitializationMode(void *self) { return self == NULL ? ERROR : OK; }                               \
    int prefix##Terminate(void *self) { return terminate(self); }                                                      \
    int prefix##EnterEventMode(void *self) { return self == NULL ? ERROR : OK; }                                       \
    int prefix##EnterContinuousTimeMode(void *self) { return self == NULL ? ERROR : OK; }                              \
    int prefix##SetTime(void *self, double time)                                                                       \
    {                                                                                                                  \
        ((instance *)self)->time = time;                                                                               \
        return OK;                                                                                                     \
    }                                                                                                                  \
    int prefix##SetContinuousStates(void *self, const double *states, size_t count)                                    \
    {                                                                                                                  \
        memcpy(((instance *)self)->states, states, count * sizeof *states);                                            \
        return OK;                                                                                                     \
    }                                                                                                                  \
    int prefix##GetContinuousStates(void *self, double *states, size_t count)                                          \
    {                                                                                                                  \
        ((instance *)self)->count = count;                                                                             \
        memcpy(states, ((instance *)self)->states, count * sizeof *states);                                            \
        return OK;                                                                                                     \
    }                                                                                                                  \
    int prefix##GetNominalsOfContinuousStates(void *self, double *nominals, size_t count)                              \
    {                                                                                                                  \
        for (size_t i = 0; i < count; i++)                                                                             \
            nominals[i] = ((instance *)self)->system == SCALED ? scale(i) : 1;                                         \
        return OK;                                                                                                     \
    }                                                                                                                  \
    int prefix##GetEventIndicators(void *self) { return self == NULL ? ERROR : OK; }                                   \
    int prefix##Get##state(void *self) { return self == NULL ? OK : ERROR; }                                           \
    int prefix##Set##state(void *self) { return self == NULL ? OK : ERROR; }                                           \
    int prefix##Free##state(void *self) { return self == NULL ? OK : ERROR; }

COMMON(fmi2, FMUstate)
COMMON(fmi3, FMUState)

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const callbacks *functions,
                      int visible, int logging)
{
    (void)name, (void)type, (void)resources, (void)visible, (void)logging;
    return instantiate(guid, functions, NULL, NULL);
}

int fmi2SetupExperiment(void *self, int a, double b, double start, int c, double d)
{
    (void)a, (void)b, (void)c, (void)d;
    ((instance *)self)->time = start;
    return OK;
}

int fmi2EnterInitializationMode(void *self)
{
    reset(self);
    return OK;
}

int fmi2DoStep(void *self, double time, double size, int no_way_back)
{
    (void)no_way_back;
    return step(self, time, size);
}

int fmi2NewDiscreteStates(void *self, struct info *info)
{
    memset(info, 0, sizeof *info);
    info->next = update(self);
    info->next_defined = !isnan(info->next);
    return OK;
}

int fmi2CompletedIntegratorStep(void *self, int no_restore, int *event, int *end)
{
    (void)no_restore;
    *event = *end = 0;
    return self == NULL ? ERROR : OK;
}

int fmi2GetDerivatives(void *self, double *derivatives, size_t count)
{
    (void)count;
    differentiate(self, NULL, derivatives);
    return OK;
}

int fmi2GetDirectionalDerivative(void *self, const unsigned *of, size_t of_count, const unsigned *by, size_t by_count,
                                 const double *seed, double *out)
{
    (void)of, (void)of_count, (void)by, (void)by_count;
    direct(self, seed, out);
    return OK;
}

int fmi2GetReal(void *self, const unsigned *references, size_t count, double *values)
{
    const instance *own = self;
    bool is_nan = own->misdeed == NAN_OUTPUT && own->time >= own->from;
    for (size_t i = 0; i < count; i++)
        values[i] = is_nan && references[i] == Y ? NAN : *real(self, references[i]);
    return OK;
}

int fmi2SetReal(void *self, const unsigned *references, size_t count, const double *values)
{
    for (size_t i = 0; i < count; i++)
        *real(self, references[i]) = values[i];
    return OK;
}

int fmi2GetInteger(void *self, const unsigned *references, size_t count, int *values)
{
    for (size_t i = 0; i < count; i++)
        values[i] = (int)*whole(self, references[i]);
    return OK;
}

int fmi2SetInteger(void *self, const unsigned *references, size_t count, const int *values)
{
    for (size_t i = 0; i < count; i++)
        *whole(self, references[i]) = values[i];
    return OK;
}

/* Everything else. */
#define REFUSED(name)                                                                                                  \
    int fmi##name(void) { return ERROR; }
REFUSED(2GetBoolean) REFUSED(2SetBoolean) REFUSED(2SetString)
REFUSED(3GetFloat32) REFUSED(3SetFloat32) REFUSED(3GetInt8) REFUSED(3SetInt8) REFUSED(3GetUInt8) REFUSED(3SetUInt8)
REFUSED(3GetInt16) REFUSED(3SetInt16) REFUSED(3GetUInt16) REFUSED(3SetUInt16) REFUSED(3GetInt32) REFUSED(3SetInt32)
REFUSED(3GetUInt32) REFUSED(3SetUInt32) REFUSED(3GetUInt64) REFUSED(3SetUInt64) REFUSED(3GetBoolean) REFUSED(3SetBoolean)
REFUSED(3SetString) REFUSED(3SetClock) REFUSED(3GetIntervalDecimal) REFUSED(3GetShiftDecimal)

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const uint32_t *required, size_t count, void *environment,
                                  logger3 *log, void *update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)required, (void)count, (void)update;
    instance *self = instantiate(token, NULL, log, environment);
    self->reports_events = events;
    self->may_return_early = early;
    return self;
}

void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                   void *environment, logger3 *log)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    return instantiate(token, NULL, log, environment);
}

int fmi3EnterInitializationMode(void *self, bool a, double b, double start, bool c, double d)
{
    (void)a, (void)b, (void)c, (void)d;
    ((instance *)self)->time = start;
    reset(self);
    return OK;
}

int fmi3DoStep(void *self, double time, double size, bool a, bool *event, bool *end, bool *early, double *reached)
{
    instance *own = self;
    (void)a;
    *event = *end = false;
    *early = own->misdeed == HALF_STEP;
    if (*early)
        size = own->status > 0 ? 0 : size / 2;
    bool is_due = own->misdeed == EVENT_IN_STEP && time < own->from && own->from < time + size;
    own->has_event = is_due || own->misdeed == EVENT_FOR_EVER;
    if (own->has_event && own->reports_events) {
        *event = true;
        *early = own->may_return_early;
        if (*early)
            size = is_due ? own->from - time : 0;
    } else {
        handle(own);
    }
    *reached = time + size;
    return step(self, time, size);
}

int fmi3EnterStepMode(void *self) { return self == NULL ? ERROR : OK; }

int fmi3UpdateDiscreteStates(void *self, bool *again, bool *end, bool *nominals, bool *values, bool *defined, double *next)
{
    *again = *end = *nominals = *values = false;
    handle(self);
    *next = update(self);
    *defined = !isnan(*next);
    return OK;
}

int fmi3CompletedIntegratorStep(void *self, bool no_restore, bool *event, bool *end)
{
    (void)no_restore;
    *event = *end = false;
    return self == NULL ? ERROR : OK;
}

int fmi3GetContinuousStateDerivatives(void *self, double *derivatives, size_t count)
{
    return fmi2GetDerivatives(self, derivatives, count);
}

int fmi3GetDirectionalDerivative(void *self, const uint32_t *of, size_t of_count, const uint32_t *by, size_t by_count,
                                 const double *seed, size_t seeds, double *out, size_t outs)
{
    return seeds == outs ? fmi2GetDirectionalDerivative(self, of, of_count, by, by_count, seed, out) : ERROR;
}

int fmi3GetFloat64(void *self, const uint32_t *references, size_t count, double *values, size_t size)
{
    return size == count ? fmi2GetReal(self, references, count, values) : ERROR;
}

int fmi3SetFloat64(void *self, const uint32_t *references, size_t count, const double *values, size_t size)
{
    return size == count ? fmi2SetReal(self, references, count, values) : ERROR;
}

int fmi3GetInt64(void *self, const uint32_t *references, size_t count, int64_t *values, size_t size)
{
    for (size_t i = 0; i < count; i++)
        values[i] = *whole(self, references[i]);
    return size == count ? OK : ERROR;
}

int fmi3SetInt64(void *self, const uint32_t *references, size_t count, const int64_t *values, size_t size)
{
    for (size_t i = 0; i < count; i++)
        *whole(self, references[i]) = values[i];
    return size == count ? OK : ERROR;
}
