/* What FMUs may change of their process, and processes that end together. */

#include <errno.h>
#include <signal.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#include <windows.h>
#else
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>
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

#ifdef _WIN32

/* Writes the handlers of signals; returns their number. */
size_t fmu_master_handlers(uintptr_t *to, size_t most)
{
    static const int signals[] = {SIGABRT, SIGFPE, SIGILL, SIGINT, SIGSEGV, SIGTERM};
    size_t count = 0;
    for (; count < sizeof signals / sizeof *signals && count < most; count++)
        to[count] = (uintptr_t)signal(signals[count], SIG_GET);
    return count;
}

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

/* Writes the handlers of signals; returns their number. */
size_t fmu_master_handlers(uintptr_t *to, size_t most)
{
    size_t count = 0;
    for (int number = 1; number < NSIG && count < most; number++) {
        struct sigaction action;
        /* Some numbers are no signals. */
        to[count++] = sigaction(number, NULL, &action) == 0 ? (uintptr_t)action.sa_handler : 0;
    }
    return count;
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
