/* Counts what a process does to files below a folder; at one of these points it is killed, or gets an error.
 *
 *     cc -shared -fPIC -o faults.so faults.c -ldl; LD_PRELOAD=./faults.so PROGRAM
 *
 * The program calls fault_arm. Writes are half done when the fault comes. A full disk (ENOSPC) stays full.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static char folder[4096];
static size_t length;
static atomic_long count;
static long point = -1;
static int fault;

void fault_arm(const char *path, long at, int error) {
    count = 0;
    point = at;
    fault = error;
    snprintf(folder, sizeof folder, "%s", path);
    length = strlen(folder);
}

long fault_count(void) { return count; }

/* 0: go on; 1: fail, errno is set; 2: end after half of the write. */
static int due(void) {
    long now = atomic_fetch_add(&count, 1);
    if (point < 0 || now < point || (now > point && fault != ENOSPC)) return 0;
    errno = fault;
    return fault == 0 ? 2 : 1;
}

static void die(void) { kill(getpid(), SIGKILL), pause(); }

static int ours(const char *path) { return length && path && strncmp(path, folder, length) == 0; }

static int ours_at(int at, const char *path) {
    char link[64], found[4096];
    if (!length) return 0;
    if (path && path[0] == '/') return ours(path);
    if (at == AT_FDCWD) return getcwd(found, sizeof found) && ours(found);
    snprintf(link, sizeof link, "/proc/self/fd/%d", at);
    ssize_t size = readlink(link, found, sizeof found - 1);
    return size > 0 && (found[size] = 0, ours(found));
}

#define REAL(name) __typeof__(&name) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

#define WRITES(name, half, arguments, ...)                                   \
    ssize_t name(__VA_ARGS__) {                                              \
        REAL(name);                                                          \
        int what = ours_at(fd, NULL) ? due() : 0, error = errno;             \
        if (what) half;                                                      \
        if (what == 2) die();                                                \
        return what ? (errno = error, -1) : real arguments;                  \
    }
WRITES(write, real(fd, data, size / 2), (fd, data, size), int fd, const void *data, size_t size)
WRITES(pwrite, real(fd, data, size / 2, at), (fd, data, size, at), int fd, const void *data, size_t size, off_t at)
WRITES(pwrite64, real(fd, data, size / 2, at), (fd, data, size, at), int fd, const void *data, size_t size, off_t at)
WRITES(writev, real(fd, parts, number / 2), (fd, parts, number), int fd, const struct iovec *parts, int number)

#define CALLS(name, where, arguments, ...)                                   \
    int name(__VA_ARGS__) {                                                  \
        REAL(name);                                                          \
        int what = where ? due() : 0;                                        \
        if (what == 2) die();                                                \
        return what ? -1 : real arguments;                                   \
    }
CALLS(fsync, ours_at(fd, NULL), (fd), int fd)
CALLS(rename, ours_at(AT_FDCWD, to), (from, to), const char *from, const char *to)
CALLS(renameat, ours_at(b, to), (a, from, b, to), int a, const char *from, int b, const char *to)
CALLS(mkdir, ours_at(AT_FDCWD, path), (path, mode), const char *path, mode_t mode)
CALLS(unlink, ours_at(AT_FDCWD, path) && fault != ENOSPC, (path), const char *path)
CALLS(unlinkat, ours_at(at, path) && fault != ENOSPC, (at, path, flags), int at, const char *path, int flags)
CALLS(rmdir, ours_at(AT_FDCWD, path) && fault != ENOSPC, (path), const char *path)

#define OPENS(name, where, arguments, ...)                                   \
    int name(__VA_ARGS__, int flags, ...) {                                  \
        REAL(name);                                                          \
        va_list rest;                                                        \
        va_start(rest, flags);                                               \
        int mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, int) : 0;    \
        va_end(rest);                                                        \
        int what = (flags & O_CREAT) && where ? due() : 0;                   \
        if (what == 2) die();                                                \
        return what ? -1 : real arguments;                                   \
    }
OPENS(open, ours_at(AT_FDCWD, path), (path, flags, mode), const char *path)
OPENS(open64, ours_at(AT_FDCWD, path), (path, flags, mode), const char *path)
OPENS(openat, ours_at(at, path), (at, path, flags, mode), int at, const char *path)
OPENS(openat64, ours_at(at, path), (at, path, flags, mode), int at, const char *path)
