"""Objects for each target, and what none of them may hold."""

import struct

import pytest

from strapdown.native.emit import TARGETS, emit

HEAD = 'target datalayout = "e"\ntarget triple = "x86_64-unknown-linux-gnu"\n'
SINE = """
declare double @sin(double)
define double @one(double %x) {
  %y = call double @helper(double %x)
  ret double %y
}
define linkonce_odr double @helper(double %x) {
  %y = call double @sin(double %x)
  %z = fmul double %y, %x
  ret double %z
}
"""
MACHINES = {"x86-64-v2": 62, "x86-64-v3": 62, "aarch64": 183, "cortex-m4f": 40, "cortex-m7": 40}
"""How ELF calls them."""


def made(body, target="x86-64-v3", exported=("one",), **options):
    return emit([HEAD + body], TARGETS[target], exported, **options)


@pytest.mark.parametrize("target", TARGETS)
def test_an_object_is_for_its_target_and_asks_for_nothing_but_mathematics(target):
    one = made(SINE, target)
    software = {"__aeabi_dmul"} if target == "cortex-m4f" else set()
    assert set(one.needed) == {"sin"} | software and one.exported == ("one",)
    if target == "wasm32":
        assert one.content.startswith(b"\0asm") and one.stack == {}
    else:
        assert struct.unpack_from("<H", one.content, 18) == (MACHINES[target],)
        assert 0 <= one.stack["one"] < 100
    assert b"helper" not in one.content


def test_a_cortex_with_a_floating_point_unit_takes_doubles_in_its_registers():
    """The flags of an ELF file for ARM say so: a triple without an ABI would pass them in
    others."""
    for target in ("cortex-m4f", "cortex-m7"):
        attributes = made(SINE, target).content
        assert b"aeabi\0" in attributes
        at = attributes.index(b"aeabi\0")
        assert b"\x1c\x01" in attributes[at : at + 80]  # Tag_ABI_VFP_args: in VFP registers


@pytest.mark.parametrize("name", ["PyErr_Clear", "numba_gamma", "malloc"])
def test_what_is_not_of_the_mathematics_of_c_is_refused_by_name(name):
    with pytest.raises(RuntimeError, match=f"^one: it needs {name}"):
        made(SINE.replace("@sin", f"@{name}"))


@pytest.mark.parametrize(
    "line",
    [
        "%z = fmul contract double %y, %x",
        "%z = fmul nsz arcp double %y, %x",
        "%z = tail call fast double @sin(double %y)",
        "%z = call double @llvm.fmuladd.f64(double %y, double %x, double %x)",
    ],
)
def test_arithmetic_that_the_compiler_may_change_is_refused(line):
    body = SINE.replace("%z = fmul double %y, %x", line)
    with pytest.raises(RuntimeError, match="^one: arithmetic is not strict"):
        made(body + "declare double @llvm.fmuladd.f64(double, double, double)\n")


def test_names_that_read_like_loose_arithmetic_are_not():
    assert made(SINE.replace("%x", "%fast").replace("%y", "%contract")).needed == ("sin",)


def test_an_address_of_the_process_that_compiled_is_refused():
    body = """
    @table = linkonce global ptr inttoptr (i64 140183777174608 to ptr)
    define ptr @one() {
      %y = load ptr, ptr @table
      ret ptr %y
    }
    """
    with pytest.raises(
        RuntimeError, match="^one: the code contains an address of the building process"
    ):
        made(body)


def test_a_function_that_is_not_there_is_refused():
    with pytest.raises(RuntimeError, match="no code of another$"):
        made(SINE, exported=("one", "another"))


def test_two_parts_may_call_different_helpers_by_one_name():
    """Each constant is in the object: neither helper took the place of the other."""
    texts = [
        HEAD + SINE.replace("fmul double %y, %x", f"fmul double %y, {number}").replace("@one", name)
        for name, number in (("@one", "7.25"), ("@two", "11.75"))
    ]
    both = emit(texts, TARGETS["aarch64"], ["one", "two"])
    wide = emit(texts, TARGETS["x86-64-v2"], ["one", "two"])
    assert both.needed == ("sin",) and set(both.stack) == {"one", "two"}
    for number in (7.25, 11.75):
        assert struct.pack("<d", number) in wide.content


FRAMES = """
declare double @sin(double)
declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)
define double @one(double %x, i64 %address) {
  %f = inttoptr i64 %address to ptr
  %y = call double %f(double %x)
  %z = fadd double %y, %x
  ret double %z
}
define double @large(double %x) {
  %room = alloca [100 x double]
  call void @llvm.memset.p0.i64(ptr %room, i8 1, i64 800, i1 true)
  %y = call double @sin(double %x)
  %z = load volatile double, ptr %room
  ret double %z
}
define double @other(double %x, double %u) {
  %room = alloca [1000 x double]
  call void @llvm.memset.p0.i64(ptr %room, i8 1, i64 8000, i1 true)
  %z = load volatile double, ptr %room
  ret double %z
}
"""


@pytest.mark.parametrize("target", ["x86-64-v3", "aarch64", "cortex-m7"])
def test_stack_is_that_of_the_longest_path_through_what_an_address_can_be(target):
    stack = made(FRAMES, target, ("one", "large", "other")).stack
    assert 800 <= stack["large"] < 900 and 8000 <= stack["other"] < 8100
    assert stack["large"] < stack["one"] < stack["large"] + 100


def test_what_calls_itself_has_no_largest_stack():
    body = """
    declare double @sin(double)
    define double @one(double %x) {
      %low = fcmp olt double %x, 1.0
      br i1 %low, label %end, label %again
    again:
      %u = call double @sin(double %x)
      %y = call double @one(double %u)
      %v = fsub double %x, 1.0
      %z = call double @one(double %v)
      %w = fmul double %y, %z
      ret double %w
    end:
      ret double %x
    }
    """
    with pytest.raises(RuntimeError, match="one calls itself"):
        made(body)


def test_what_llvm_says_besides_is_not_swallowed(capfd):
    made(SINE)
    assert capfd.readouterr().err == ""
