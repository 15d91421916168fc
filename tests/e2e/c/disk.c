/* A disk and a clock that misbehave, put before libc by LD_PRELOAD.

   It counts what the processes of a run do to files under one folder (its operations), and from a given operation on it lets them
   fail, kills a process, or writes down all of them, so that a test can build what a power cut would have left. It moves the clock.
   What is to happen stands in a file that all processes share (`struct orders`); tests/e2e/src/disk.rs has the same layout.

   FAULTS_UNDER   the folder, absolute and without links
   FAULTS_ORDERS  the file of orders
   FAULTS_LOG     where operations are written down; unset: nowhere */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

struct orders {
  _Atomic int64_t operations; /* done so far by all processes */
  _Atomic int64_t fail_from;  /* this operation fails, and those after it; -1: none */
  _Atomic int64_t fail_until; /* up to this one, without it; -1: all */
  _Atomic int64_t error;      /* with this errno */
  _Atomic int64_t kill_at;    /* before this operation a process is killed; -1: never */
  _Atomic int64_t victim;     /* 1: the head, 2: the process that wants the operation, 3: both */
  _Atomic int64_t torn;       /* 1: half of a write that is killed, or fails, is done */
  _Atomic int64_t head;       /* process number of the head, set by itself */
  _Atomic int64_t clock;      /* s by which the clock is wrong */
  _Atomic int64_t failures;   /* operations that were made to fail */
  _Atomic int64_t hold;       /* 1: workers wait before they do anything */
  _Atomic int64_t held;       /* workers that have waited */
};

enum { NOTHING, CREATE, WRITE, TRUNCATE, SYNC, RENAME, UNLINK, MKDIR, RMDIR };

/* One operation in the log, followed by the path, the second path or the data. */
struct entry {
  uint32_t kind, path, more, process;
  uint64_t inode;
  int64_t offset;
};

static struct orders *orders;
static const char *under;
static size_t under_length;
static int log_file = -1;
static pid_t log_owner;
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;

#define REAL(result, name, ...)                                                                                              \
  static result (*real_##name)(__VA_ARGS__);                                                                                 \
  static void find_##name(void) {                                                                                            \
    if (!real_##name) *(void **)&real_##name = dlsym(RTLD_NEXT, #name);                                                       \
  }
REAL(int, open, const char *, int, ...)
REAL(int, openat, int, const char *, int, ...)
REAL(int, openat64, int, const char *, int, ...)
REAL(ssize_t, write, int, const void *, size_t)
REAL(ssize_t, writev, int, const struct iovec *, int)
REAL(ssize_t, pwrite, int, const void *, size_t, off_t)
REAL(int, ftruncate, int, off_t)
REAL(int, fsync, int)
REAL(int, fdatasync, int)
REAL(int, rename, const char *, const char *)
REAL(int, unlinkat, int, const char *, int)
REAL(int, mkdir, const char *, mode_t)
REAL(int, clock_gettime, clockid_t, struct timespec *)

__attribute__((constructor)) static void begin(void) {
  const char *file = getenv("FAULTS_ORDERS");
  under = getenv("FAULTS_UNDER");
  if (!file || !under) return;
  under_length = strlen(under);
  find_open();
  int fd = real_open(file, O_RDWR | O_CLOEXEC);
  if (fd < 0) return;
  void *at = mmap(NULL, sizeof(struct orders), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  close(fd);
  if (at == MAP_FAILED) return;
  orders = at;
  char line[4096];
  fd = real_open("/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
  ssize_t n = fd < 0 ? 0 : read(fd, line, sizeof line);
  if (fd >= 0) close(fd);
  if (n > 0 && !memmem(line, (size_t)n, "step-worker", 11)) orders->head = getpid();
  if (n > 0 && memmem(line, (size_t)n, "--parent", 8) && orders->hold) {
    atomic_fetch_add(&orders->held, 1);
    while (orders->hold) usleep(1000);
  }
}

/* The absolute path of a name below a folder; 0 when it cannot be told. */
static int full_path(int folder, const char *name, char *out) {
  if (name[0] == '/') return snprintf(out, PATH_MAX, "%s", name) < PATH_MAX;
  char link[64];
  snprintf(link, sizeof link, folder == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/%d", folder);
  ssize_t n = readlink(link, out, PATH_MAX - 1);
  if (n <= 0) return 0;
  return snprintf(out + n, PATH_MAX - (size_t)n, "/%s", name) < PATH_MAX - n;
}

static int is_under(const char *path) {
  return orders && !strncmp(path, under, under_length) && (path[under_length] == '/' || !path[under_length]);
}

static int file_path(int fd, char *out) {
  char link[64];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  ssize_t n = readlink(link, out, PATH_MAX - 1);
  out[n > 0 ? n : 0] = 0;
  return is_under(out);
}

static uint64_t inode_of(int fd) {
  struct stat s;
  return fstat(fd, &s) ? 0 : s.st_ino;
}

/* The log is held from before an operation until it is written down, so that their order is that of the file system. */
static void hold(void) {
  pthread_mutex_lock(&mutex);
  const char *path = getenv("FAULTS_LOG");
  if (!path) return;
  if (log_owner != getpid()) {
    log_file = real_open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    log_owner = getpid();
  }
  flock(log_file, LOCK_EX);
}

static void release(void) {
  int kept = errno;
  if (getenv("FAULTS_LOG")) flock(log_file, LOCK_UN);
  pthread_mutex_unlock(&mutex);
  errno = kept;
}

static void note(uint32_t kind, uint64_t inode, int64_t offset, const char *path, const void *more, size_t length) {
  if (!getenv("FAULTS_LOG")) return;
  struct entry e = {kind, (uint32_t)strlen(path), (uint32_t)length, (uint32_t)getpid(), inode, offset};
  struct iovec parts[] = {{&e, sizeof e}, {(void *)path, e.path}, {(void *)more, length}};
  find_writev();
  int kept = errno;
  if (real_writev(log_file, parts, 3) != (ssize_t)(sizeof e + e.path + length)) abort();
  errno = kept;
}

static void kill_now(void) {
  if (orders->victim & 1 && orders->head) kill((pid_t)orders->head, SIGKILL);
  if (orders->victim & 2) kill(getpid(), SIGKILL);
  /* The kernel takes a moment to end the others. */
  usleep(50000);
}

/* Counts an operation. 0: do it; 1: it is to fail with errno as set; 2: half of it, then as the orders say. */
static int admit(uint32_t kind) {
  int64_t number = atomic_fetch_add(&orders->operations, 1);
  if (orders->kill_at >= 0 && number == orders->kill_at) {
    if (orders->torn && kind == WRITE) return 2;
    kill_now();
  }
  int64_t from = orders->fail_from, until = orders->fail_until;
  if (from < 0 || number < from || (until >= 0 && number >= until)) return 0;
  int error = (int)orders->error;
  /* A full disk takes nothing new, but gives free what it has. */
  int takes_nothing = kind == SYNC || kind == RENAME || kind == UNLINK || kind == RMDIR || kind == TRUNCATE;
  if ((error == ENOSPC || error == EDQUOT) && takes_nothing) return 0;
  atomic_fetch_add(&orders->failures, 1);
  errno = error;
  return orders->torn && kind == WRITE && number == from ? 2 : 1;
}

static int opened(int folder, const char *name, int flags, mode_t mode, int (*real)(int, const char *, int, mode_t)) {
  char path[PATH_MAX];
  int writes = (flags & O_ACCMODE) != O_RDONLY || flags & (O_CREAT | O_TRUNC);
  if (flags & O_PATH || !orders || !writes || !full_path(folder, name, path) || !is_under(path))
    return real(folder, name, flags, mode);
  struct stat before;
  int was = !fstatat(folder, name, &before, 0);
  int changes = (!was && flags & O_CREAT) || (was && flags & O_TRUNC && before.st_size > 0);
  if (!changes) {
    /* It may be written to, which a disk that is not to be written to refuses. */
    if (orders->fail_from >= 0 && orders->error == EROFS && orders->operations >= orders->fail_from) {
      atomic_fetch_add(&orders->failures, 1);
      errno = EROFS;
      return -1;
    }
    return real(folder, name, flags, mode);
  }
  hold();
  int fd = -1;
  if (!admit(was ? TRUNCATE : CREATE)) {
    fd = real(folder, name, flags, mode);
    note(fd < 0 ? NOTHING : was ? TRUNCATE : CREATE, inode_of(fd), 0, path, NULL, 0);
  }
  release();
  return fd;
}

static int real_at(int folder, const char *name, int flags, mode_t mode) {
  find_openat();
  return real_openat(folder, name, flags, mode);
}

static int real_at64(int folder, const char *name, int flags, mode_t mode) {
  find_openat64();
  return real_openat64(folder, name, flags, mode);
}

#define MODE(flags)                                                                                                          \
  mode_t mode = 0;                                                                                                           \
  if ((flags) & O_CREAT || ((flags) & O_TMPFILE) == O_TMPFILE) {                                                             \
    va_list list;                                                                                                            \
    va_start(list, flags);                                                                                                   \
    mode = va_arg(list, mode_t);                                                                                             \
    va_end(list);                                                                                                            \
  }

int open(const char *name, int flags, ...) {
  MODE(flags)
  return opened(AT_FDCWD, name, flags, mode, real_at);
}

int open64(const char *name, int flags, ...) {
  MODE(flags)
  return opened(AT_FDCWD, name, flags, mode, real_at64);
}

int openat(int folder, const char *name, int flags, ...) {
  MODE(flags)
  return opened(folder, name, flags, mode, real_at);
}

int openat64(int folder, const char *name, int flags, ...) {
  MODE(flags)
  return opened(folder, name, flags, mode, real_at64);
}

int creat(const char *name, mode_t mode) { return opened(AT_FDCWD, name, O_CREAT | O_WRONLY | O_TRUNC, mode, real_at); }

/* All writes: at `offset`, or where the file stands (-1). */
static ssize_t written(int fd, const void *data, size_t length, off_t offset) {
  char path[PATH_MAX];
  find_write();
  find_pwrite();
  if (!orders || !file_path(fd, path) || !length)
    return offset < 0 ? real_write(fd, data, length) : real_pwrite(fd, data, length, offset);
  hold();
  off_t at = offset;
  if (at < 0) at = lseek(fd, 0, fcntl(fd, F_GETFL) & O_APPEND ? SEEK_END : SEEK_CUR);
  int verdict = admit(WRITE), error = errno;
  ssize_t n = -1;
  if (verdict == 2) length = (length + 1) / 2;
  if (verdict != 1) n = offset < 0 ? real_write(fd, data, length) : real_pwrite(fd, data, length, offset);
  else errno = error;
  note(n > 0 ? WRITE : NOTHING, inode_of(fd), at, path, data, n > 0 ? (size_t)n : 0);
  if (verdict == 2 && orders->kill_at >= 0) kill_now();
  release();
  return n;
}

ssize_t write(int fd, const void *data, size_t length) { return written(fd, data, length, -1); }
ssize_t pwrite(int fd, const void *data, size_t length, off_t offset) { return written(fd, data, length, offset); }
ssize_t pwrite64(int fd, const void *data, size_t length, off_t offset) { return written(fd, data, length, offset); }

ssize_t writev(int fd, const struct iovec *parts, int count) {
  char path[PATH_MAX];
  if (!orders || !file_path(fd, path)) {
    find_writev();
    return real_writev(fd, parts, count);
  }
  for (int i = 0; i < count; i++)
    if (parts[i].iov_len) return written(fd, parts[i].iov_base, parts[i].iov_len, -1);
  return 0;
}

/* What copies inside of the kernel is not there: who copies writes. */
ssize_t copy_file_range(int in, off_t *from, int out, off_t *to, size_t n, unsigned flags) {
  (void)in, (void)from, (void)out, (void)to, (void)n, (void)flags;
  errno = ENOSYS;
  return -1;
}

ssize_t sendfile64(int out, int in, off_t *from, size_t n) {
  (void)out, (void)in, (void)from, (void)n;
  errno = ENOSYS;
  return -1;
}

ssize_t sendfile(int out, int in, off_t *from, size_t n) { return sendfile64(out, in, from, n); }

int ftruncate(int fd, off_t length) {
  char path[PATH_MAX];
  find_ftruncate();
  if (!orders || !file_path(fd, path)) return real_ftruncate(fd, length);
  hold();
  int code = -1;
  if (!admit(TRUNCATE)) {
    code = real_ftruncate(fd, length);
    note(code ? NOTHING : TRUNCATE, inode_of(fd), length, path, NULL, 0);
  }
  release();
  return code;
}

int ftruncate64(int fd, off_t length) { return ftruncate(fd, length); }

static int synced(int fd, int (*real)(int)) {
  char path[PATH_MAX];
  if (!orders || !file_path(fd, path)) return real(fd);
  hold();
  int code = -1;
  if (!admit(SYNC)) {
    code = real(fd);
    note(code ? NOTHING : SYNC, inode_of(fd), 0, path, NULL, 0);
  }
  release();
  return code;
}

int fsync(int fd) {
  find_fsync();
  return synced(fd, real_fsync);
}

int fdatasync(int fd) {
  find_fdatasync();
  return synced(fd, real_fdatasync);
}

int rename(const char *from, const char *to) {
  char a[PATH_MAX], b[PATH_MAX];
  find_rename();
  if (!orders || !full_path(AT_FDCWD, from, a) || !full_path(AT_FDCWD, to, b) || !(is_under(a) || is_under(b)))
    return real_rename(from, to);
  hold();
  int code = -1;
  if (!admit(RENAME)) {
    code = real_rename(from, to);
    note(code ? NOTHING : RENAME, 0, 0, a, b, strlen(b));
  }
  release();
  return code;
}

static int removed(int folder, const char *name, int flags) {
  char path[PATH_MAX];
  find_unlinkat();
  struct stat s;
  if (!orders || !full_path(folder, name, path) || !is_under(path) || fstatat(folder, name, &s, AT_SYMLINK_NOFOLLOW))
    return real_unlinkat(folder, name, flags);
  hold();
  uint32_t kind = flags & AT_REMOVEDIR ? RMDIR : UNLINK;
  int code = -1;
  if (!admit(kind)) {
    code = real_unlinkat(folder, name, flags);
    note(code ? NOTHING : kind, s.st_ino, 0, path, NULL, 0);
  }
  release();
  return code;
}

int unlink(const char *name) { return removed(AT_FDCWD, name, 0); }
int unlinkat(int folder, const char *name, int flags) { return removed(folder, name, flags); }
int rmdir(const char *name) { return removed(AT_FDCWD, name, AT_REMOVEDIR); }

int mkdir(const char *name, mode_t mode) {
  char path[PATH_MAX];
  find_mkdir();
  struct stat s;
  if (!orders || !full_path(AT_FDCWD, name, path) || !is_under(path) || !lstat(name, &s)) return real_mkdir(name, mode);
  hold();
  int code = -1;
  if (!admit(MKDIR)) {
    code = real_mkdir(name, mode);
    note(code ? NOTHING : MKDIR, 0, 0, path, NULL, 0);
  }
  release();
  return code;
}

int clock_gettime(clockid_t clock, struct timespec *at) {
  find_clock_gettime();
  int code = real_clock_gettime(clock, at);
  if (!code && orders && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) at->tv_sec += orders->clock;
  return code;
}

time_t time(time_t *out) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (out) *out = now.tv_sec;
  return now.tv_sec;
}

int gettimeofday(struct timeval *restrict at, void *restrict zone) {
  (void)zone;
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  at->tv_sec = now.tv_sec;
  at->tv_usec = now.tv_nsec / 1000;
  return 0;
}
