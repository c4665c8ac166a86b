/* LD_PRELOAD: one call of the C library, counted over all threads, is answered with an error or does only a part of what it
 * is asked for, as it may by its contract: FAULT=pread64:3:5 fails the third with EIO, FAULT=write:2:0 shortens the second.
 * FAULT_COUNTS, a file, takes the name of each call instead, with "short" behind what could be shortened. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

/* Errno of this call, 0 if it is to be shortened, -1 if nothing is wrong with it. */
static int fault(const char *call, atomic_int *count, int can_be_short) {
  const char *counts = getenv("FAULT_COUNTS"), *which = getenv("FAULT");
  if (counts) {
    static int (*open_)(const char *, int, ...);
    static ssize_t (*write_)(int, const void *, size_t);
    if (!open_) open_ = (int (*)(const char *, int, ...))dlsym(RTLD_NEXT, "open64");
    if (!write_) write_ = (ssize_t (*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
    int fd = open_(counts, O_WRONLY | O_APPEND | O_CLOEXEC);
    char line[48];
    int length = snprintf(line, sizeof line, "%s%s\n", call, can_be_short ? " short" : "");
    if (fd >= 0) { write_(fd, line, length); close(fd); }
    return -1;
  }
  size_t length = strlen(call);
  if (!which || strncmp(which, call, length) || which[length] != ':') return -1;
  char *end;
  long nth = strtol(which + length + 1, &end, 10);
  return atomic_fetch_add(count, 1) + 1 == nth && *end == ':' ? atoi(end + 1) : -1;
}

#define FIND(name) \
  static __typeof__(name) *next; \
  if (!next) next = (__typeof__(name) *)dlsym(RTLD_NEXT, #name); \
  static atomic_int count
#define FAIL(name, asked) \
  FIND(name); \
  int wrong = fault(#name, &count, (asked) > 8); \
  if (wrong > 0) { errno = wrong; return -1; }
/* Whole as it is asked for: what only signals, and numbers of eight bytes. */
#define PART(n) (wrong == 0 && (n) > 8 ? (n) / 3 + 1 : (n))

ssize_t read(int fd, void *to, size_t n) { FAIL(read, n); return next(fd, to, PART(n)); }
ssize_t write(int fd, const void *from, size_t n) { 
  if (n <= 8) { FIND(write); (void)count; return next(fd, from, n); }
  FAIL(write, n);
  return next(fd, from, PART(n));
}
ssize_t pread64(int fd, void *to, size_t n, off64_t at) { FAIL(pread64, n); return next(fd, to, PART(n), at); }
ssize_t pwrite64(int fd, const void *from, size_t n, off64_t at) { FAIL(pwrite64, n); return next(fd, from, PART(n), at); }
ssize_t copy_file_range(int in, off64_t *from, int out, off64_t *to, size_t n, unsigned flags) {
  FAIL(copy_file_range, n);
  return next(in, from, out, to, PART(n), flags);
}
int open64(const char *path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  int mode = va_arg(rest, int);
  va_end(rest);
  FAIL(open64, 0);
  return next(path, flags, mode);
}
int fsync(int fd) { FAIL(fsync, 0); return next(fd); }
int fdatasync(int fd) { FAIL(fdatasync, 0); return next(fd); }
int ftruncate64(int fd, off64_t length) { FAIL(ftruncate64, 0); return next(fd, length); }
int rename(const char *from, const char *to) { FAIL(rename, 0); return next(from, to); }
int unlink(const char *path) { FAIL(unlink, 0); return next(path); }
int flock(int fd, int how) { FAIL(flock, 0); return next(fd, how); }
