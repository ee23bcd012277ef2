/* The clock of a process, for LD_PRELOAD, is that of its processor: limits in seconds are limits of
   CPU seconds, however busy the machine is.  Waits for conditions, as for the interpreter's lock,
   still take the time of the machine: a moment by the other clock is long past for it, and threads
   would spin.  The processor's time is read again after a millisecond at the earliest: a solver asks
   in every iteration, and where system calls are slow, reading it takes a part of a short budget. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define LEAST 1000000 /* nanoseconds */

static int (*own)(clockid_t, struct timespec *);

int clock_gettime(clockid_t clock, struct timespec *t)
{
    static __thread struct timespec cpu;
    static __thread long long last;
    struct timespec now;
    long long since;

    if (!own)
        own = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    if (clock != CLOCK_MONOTONIC)
        return own(clock, t);
    own(CLOCK_MONOTONIC, &now);
    since = now.tv_sec * 1000000000LL + now.tv_nsec - last;
    if (!last || since >= LEAST) {
        last += since;
        syscall(SYS_clock_gettime, CLOCK_PROCESS_CPUTIME_ID, &cpu);
    }
    *t = cpu;
    return 0;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                           const struct timespec *moment)
{
    struct timespec at, now;
    long long left;

    clock_gettime(CLOCK_MONOTONIC, &at);
    own(CLOCK_MONOTONIC, &now);
    left = (moment->tv_sec - at.tv_sec) * 1000000000LL + moment->tv_nsec - at.tv_nsec;
    left = (left > 0 ? left : 0) + now.tv_nsec;
    now.tv_sec += left / 1000000000LL;
    now.tv_nsec = left % 1000000000LL;
    return pthread_cond_clockwait(condition, mutex, CLOCK_MONOTONIC, &now);
}
