"""No call that only POSIX has outside what is marked by `if sys.platform`, and no text file in the
encoding of the system."""

import ast
from pathlib import Path

import pytest

import strapdown
import strapdown_reproductions
import strapdown_ros2

pytestmark = pytest.mark.short
LIBRARIES = strapdown, strapdown_reproductions, strapdown_ros2
PACKAGES = [Path(each.__file__).parent for each in LIBRARIES]
FILES = sorted(file for package in PACKAGES for file in package.rglob("*.py"))
MODULES = {"fcntl", "grp", "msvcrt", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
"""Which some system has not."""
OS = set(
    "O_DIRECTORY O_NOFOLLOW O_NONBLOCK WNOHANG chmod chown chroot fchmod fchown fdatasync fork forkpty "
    "geteuid getgid getloadavg getpgid getuid kill killpg lchown mkfifo mknod nice openpty "
    "posix_fadvise pread pwrite register_at_fork sched_getaffinity sched_setaffinity setsid setuid "
    "statvfs sync sysconf umask uname wait waitid waitpid".split()
)
SIGNALS = set("SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGUSR1 SIGUSR2".split())
SIGNALS |= {"alarm", "pause", "setitimer", "sigwait", "pthread_kill"}
PLACES = ("/dev/", "/proc/", "/tmp", "/etc/", "/usr/")


def found(node):
    """What only some systems have, in a tree; what stands below `if sys.platform` is left out."""
    if isinstance(node, ast.If) and "sys.platform" in ast.unparse(node.test):
        return
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in MODULES)
    if isinstance(node, ast.ImportFrom):
        yield from [node.module] if node.module in MODULES else ()
        names = {"os": OS, "signal": SIGNALS}.get(node.module or "", set())
        yield from (alias.name for alias in node.names if alias.name in names)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        if node.attr in {"os": OS, "signal": SIGNALS}.get(node.value.id, ()):
            yield f"{node.value.id}.{node.attr}"
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield from [node.value] if node.value.startswith(PLACES) else ()
    if isinstance(node, ast.Call) and "encoding" not in {each.arg for each in node.keywords}:
        called = ast.unparse(node.func)
        mode = [each.value for each in node.args[1:2] if isinstance(each, ast.Constant)]
        if called.endswith((".read_text", ".write_text")) or (
            called == "open" and "b" not in (mode or [""])[0]
        ):
            yield f"{called} without encoding"
    for child in ast.iter_child_nodes(node):
        yield from found(child)


def test_only_what_every_system_has_is_called():
    assert len(FILES) > 300
    trees = {str(file): ast.parse(file.read_text(encoding="utf-8")) for file in FILES}
    assert not {name: words for name, tree in trees.items() if (words := list(found(tree)))}


def test_what_only_posix_has_is_found():
    code = """
import os, fcntl
from signal import SIGKILL
os.fork(); open("/dev/null"); open("a", "rb"); open("a", encoding="utf-8")
if sys.platform == "win32":
    import msvcrt
else:
    os.umask(0)
"""
    assert list(found(ast.parse(code))) == [
        "fcntl",
        "SIGKILL",
        "os.fork",
        "open without encoding",
        "/dev/null",
    ]
