/* What FMUs may change of their process, and processes that end together. */

#include <errno.h>
#include <locale.h>
#include <signal.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#include <windows.h>
#else
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>
#endif
#ifdef __linux__
#include <sys/prctl.h>
#endif

/* Standard input is empty from now on, and standard output goes where standard error does. Returns whether that worked. */
int fmu_master_detach(void)
{
#ifdef _WIN32
    int empty = _open("NUL", _O_RDONLY);
    if (empty < 0 || _dup2(empty, 0) != 0 || _dup2(2, 1) != 0)
        return 0;
    _close(empty);
    return SetStdHandle(STD_INPUT_HANDLE, (HANDLE)_get_osfhandle(0)) &&
           SetStdHandle(STD_OUTPUT_HANDLE, (HANDLE)_get_osfhandle(1));
#else
    int empty = open("/dev/null", O_RDONLY);
    if (empty < 0 || dup2(empty, 0) < 0 || dup2(2, 1) < 0)
        return 0;
    if (empty > 0)
        close(empty);
    return 1;
#endif
}

/* Maps a file of a size into memory, to write it; NULL if that fails. */
void *fmu_master_map(intptr_t file, size_t size)
{
#ifdef _WIN32
    HANDLE mapping = CreateFileMappingW((HANDLE)file, NULL, PAGE_READWRITE, 0, 0, NULL);
    if (mapping == NULL)
        return NULL;
    void *mapped = MapViewOfFile(mapping, FILE_MAP_WRITE, 0, 0, size);
    CloseHandle(mapping);
    return mapped;
#else
    void *mapped = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, (int)file, 0);
    return mapped == MAP_FAILED ? NULL : mapped;
#endif
}

/* Numbers as they are written. */
typedef struct {
    uintptr_t *to;
    size_t count, most;
} numbers;

static void put(numbers *all, uintptr_t number)
{
    if (all->count < all->most)
        all->to[all->count++] = number;
}

/* Adds a number to a hash (Fowler, Noll and Vo, FNV-1a). */
static uintptr_t hashed(uintptr_t hash, uintptr_t number)
{
    return (hash ^ number) * 16777619u;
}

static void put_locale(numbers *all)
{
    uintptr_t hash = 2166136261u;
    const char *locale = setlocale(LC_ALL, NULL);
    for (; locale != NULL && *locale != '\0'; locale++)
        hash = hashed(hash, (unsigned char)*locale);
    put(all, hash);
}

#ifdef _WIN32

/* Writes what FMUs can change of their process; returns how many numbers these are. */
size_t fmu_master_state(uintptr_t *to, size_t most)
{
    static const int signals[] = {SIGABRT, SIGFPE, SIGILL, SIGINT, SIGSEGV, SIGTERM};
    numbers all = {to, 0, most};
    put_locale(&all);
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++)
        put(&all, (uintptr_t)signal(signals[i], SIG_GET));
    return all.count;
}

/* Writes a number for each of the first descriptors, 0 for one that is closed. */
void fmu_master_descriptors(uintptr_t *to, size_t count)
{
    for (size_t i = 0; i < count; i++)
        to[i] = 0;
}

/* The mask of file modes, which does not exist here. */
unsigned fmu_master_mode_mask(void) { return 0; }

/* Makes the process one to write files in. */
void fmu_master_restore(unsigned mode_mask) { (void)mode_mask; }

/* Has a function called in each process that this one forks. */
void fmu_master_watch_forks(void (*forked)(void)) { (void)forked; }

/* Jobs end with their process, whatever leaves them. */
void fmu_master_adopt(void) {}
int fmu_master_has_children(void) { return 0; }
void fmu_master_end_child(intptr_t process) { (void)process; }

/* Whether a process has ended. */
int fmu_master_has_ended(intptr_t process) { return WaitForSingleObject((HANDLE)process, 0) == WAIT_OBJECT_0; }

/* The job of a process that has just begun, which ends with this process; 0 on failure. */
intptr_t fmu_master_group(intptr_t process)
{
    HANDLE job = CreateJobObjectW(NULL, NULL);
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION limits = {0};
    limits.BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE;
    if (job != NULL && SetInformationJobObject(job, JobObjectExtendedLimitInformation, &limits, sizeof limits) &&
        AssignProcessToJobObject(job, (HANDLE)process))
        return (intptr_t)job;
    if (job != NULL)
        CloseHandle(job);
    return 0;
}

void fmu_master_await(intptr_t process) { WaitForSingleObject((HANDLE)process, INFINITE); }

void fmu_master_end_group(intptr_t job, intptr_t process)
{
    TerminateJobObject((HANDLE)job, 1);
    fmu_master_await(process);
}

void fmu_master_forget_group(intptr_t job) { CloseHandle((HANDLE)job); }

void fmu_master_end_own_group(void) { TerminateProcess(GetCurrentProcess(), 1); }

#else

/* The mask of file modes. */
unsigned fmu_master_mode_mask(void)
{
    mode_t mask = umask(0);
    umask(mask);
    return (unsigned)mask;
}

/* Whether this process has children. */
int fmu_master_has_children(void)
{
    siginfo_t any;
    return waitid(P_ALL, 0, &any, WEXITED | WNOHANG | WNOWAIT) == 0;
}

/* Writes what FMUs can change of their process; returns how many numbers these are. */
size_t fmu_master_state(uintptr_t *to, size_t most)
{
    numbers all = {to, 0, most};
    put_locale(&all);
    put(&all, fmu_master_mode_mask());
    put(&all, (uintptr_t)getpriority(PRIO_PROCESS, 0));
    put(&all, (uintptr_t)getpgrp());
    put(&all, (uintptr_t)getsid(0));
    put(&all, (uintptr_t)geteuid());
    put(&all, (uintptr_t)fmu_master_has_children());
    sigset_t blocked;
    sigemptyset(&blocked);
    pthread_sigmask(SIG_SETMASK, NULL, &blocked);
    for (int number = 1; number < NSIG; number++) {
        struct sigaction action;
        /* Some numbers are no signals. */
        put(&all, sigaction(number, NULL, &action) == 0 ? (uintptr_t)action.sa_handler : 0);
        put(&all, sigismember(&blocked, number) == 1);
    }
    for (int kind = 0; kind < (int)RLIM_NLIMITS; kind++) {
        struct rlimit limit = {0, 0};
        getrlimit(kind, &limit);
        put(&all, (uintptr_t)limit.rlim_cur);
        put(&all, (uintptr_t)limit.rlim_max);
    }
    static const int timers[] = {ITIMER_REAL, ITIMER_VIRTUAL, ITIMER_PROF};
    for (size_t i = 0; i < sizeof timers / sizeof *timers; i++) {
        struct itimerval timer = {{0, 0}, {0, 0}};
        getitimer(timers[i], &timer);
        put(&all, timer.it_value.tv_sec != 0 || timer.it_value.tv_usec != 0);
    }
    return all.count;
}

enum { MOST_DESCRIPTORS = 256 };

/* Writes a number for each of the first descriptors, 0 for one that is closed. */
void fmu_master_descriptors(uintptr_t *to, size_t count)
{
    struct pollfd polled[MOST_DESCRIPTORS];
    if (count > MOST_DESCRIPTORS)
        count = MOST_DESCRIPTORS;
    for (size_t i = 0; i < count; i++)
        polled[i] = (struct pollfd){(int)i, 0, 0};
    /* A single call finds the open ones; it fails if an FMU has lowered their number. */
    int found = poll(polled, (nfds_t)count, 0);
    for (size_t i = 0; i < count; i++) {
        struct stat file;
        to[i] = 0;
        if ((found < 0 || !(polled[i].revents & POLLNVAL)) && fstat((int)i, &file) == 0)
            to[i] = hashed(hashed(hashed(1, (uintptr_t)file.st_dev), (uintptr_t)file.st_ino),
                           (uintptr_t)fcntl((int)i, F_GETFL)) | 1;
    }
}

/* Makes the process one to write files in: with a mask of file modes, and so that no file gets a standard descriptor. */
void fmu_master_restore(unsigned mode_mask)
{
    umask((mode_t)mode_mask);
    for (int i = 0; i <= 2; i++)
        if (fcntl(i, F_GETFD) < 0)
            /* The lowest that is free. */
            (void)open("/dev/null", i == 0 ? O_RDONLY : O_WRONLY);
}

/* Has a function called in each process that this one forks. */
void fmu_master_watch_forks(void (*forked)(void)) { pthread_atfork(NULL, NULL, forked); }

/* From now on, processes whose parents have ended become children of this one, where the system has that. */
void fmu_master_adopt(void)
{
#ifdef PR_SET_CHILD_SUBREAPER
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0);
#endif
}

/* Ends a child. */
void fmu_master_end_child(intptr_t process)
{
    kill((pid_t)process, SIGKILL);
    while (waitpid((pid_t)process, NULL, 0) < 0 && errno == EINTR)
        ;
}

/* Whether a process has ended; it stays to be reaped. */
int fmu_master_has_ended(intptr_t process)
{
    siginfo_t ended;
    ended.si_pid = 0;
    return waitid(P_PID, (id_t)process, &ended, WEXITED | WNOHANG | WNOWAIT) == 0 && ended.si_pid != 0;
}

/* The group of a process that leads one. */
intptr_t fmu_master_group(intptr_t process) { return process; }

/* Waits for the end of a process, which stays to be reaped. */
void fmu_master_await(intptr_t process)
{
    siginfo_t ended;
    while (waitid(P_PID, (id_t)process, &ended, WEXITED | WNOWAIT) != 0 && errno == EINTR)
        ;
}

/* Ends a group of processes, and waits for the end of the first. */
void fmu_master_end_group(intptr_t group, intptr_t process)
{
    kill((pid_t)-group, SIGKILL);
    /* It may have left its group. */
    kill((pid_t)process, SIGKILL);
    fmu_master_await(process);
}

void fmu_master_forget_group(intptr_t group) { (void)group; }

/* Ends this process and its group. */
void fmu_master_end_own_group(void) { kill(0, SIGKILL); }

#endif
