# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The parts of serial_rig without ROS and without a port: lines, clock, air, conversation."""

from hypothesis import given
from hypothesis import strategies as st
import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from fam_bundle_ros.nodes.air import Air, Order
from fam_bundle_ros.nodes.board import Board, BoardClock, DRIFT, Talk
from fam_bundle_ros.nodes.serial_protocol import (
    BoardSample,
    command_line,
    frame,
    GarbledLineError,
    Hello,
    hello_line,
    LineSplitter,
    LONGEST,
    read_line,
)

SAMPLE = 'S,17,4294967295,9,0,2,-12.5,1e1,601.3,0.1,nan'


def said(body):
    """Return what a body with a right checksum says."""
    return read_line(frame(body).strip())


# --- lines ------------------------------------------------------------------------------------

def test_sample_is_read_as_documented():
    """Number, board time, command, button, air, force, contraction, supply, pressures."""
    sample = said(SAMPLE)
    assert sample.pressure[1] != sample.pressure[1]
    assert sample == BoardSample(17, 2**32 - 1, 9, False, 2, -12.5, 10.0, 601.3,
                                 (0.1, sample.pressure[1]))
    assert said('S,0,0,0,1,0,1,2,,3').supply is None
    assert said('S,0,0,0,1,0,1,2,,3').stop is True


def test_hello_is_read_whatever_the_version():
    """Another version is told from garbage, so that the user hears of it."""
    assert said('H,1,2,my rig') == Hello(1, 2, 'my rig')
    assert said('H,3,x').version == 3
    assert hello_line() == b'H,1*1D69\n'


def test_command_is_written_in_thousandths():
    """Rounded, not cut off; counters wrap at 32 bit."""
    assert command_line(2**32 + 3, -1, False, True, [0.0296, -0.5, 1.0]).startswith(
        b'C,3,4294967295,0,1,30,-500,1000*')


@given(st.integers(0, len(SAMPLE) + 4), st.integers(1, 255))
def test_one_wrong_byte_is_always_found(place, change):
    """The CRC sees every change of one byte, of the checksum too."""
    data = bytearray(frame(SAMPLE).strip())
    data[place] ^= change
    with pytest.raises(GarbledLineError):
        read_line(bytes(data))


@given(st.binary(max_size=120))
def test_garbage_is_garbled_and_nothing_worse(data):
    """Whatever comes, the only answer is GarbledLineError."""
    with pytest.raises(GarbledLineError):
        read_line(data)


@pytest.mark.parametrize('body', [
    '', 'X,1', 'C,1,2,0,0,0', 'H,-1', 'H,1,2', 'H,1,2,a,b', 'S,1,2,3,0,0,1,2',
    'S,1,2,3,2,0,1,2,3,4', 'S,1,2,3,0,10,1,2,3,4', 'S,1,2,3,0,0,inf,2,3,4',
    'S,1,2,3,0,0,1_0,2,3,4', 'S,1,2,3,0,0, 1,2,3,4', 'S,1,2,3,0,0,,2,3,4',
    'S,1.0,2,3,0,0,1,2,3,4', 'S,1,4294967296,3,0,0,1,2,3,4', 'S,1,2,3,0,0,1,2,3,0x4',
    'S,1,2,3,0,0,1,2,3,', 'S,1,2,3,0,0,1e9999,2,3,4'])
def test_line_that_is_not_of_the_protocol_fails(body):
    """A right checksum does not make a wrong line right."""
    with pytest.raises(GarbledLineError):
        said(body)


@given(st.lists(st.binary(max_size=40).map(lambda b: b.replace(b'\n', b'').replace(b'\r', b'')),
                max_size=8), st.integers(1, 50))
def test_lines_are_the_same_however_they_are_cut(lines, size):
    """One byte at a time or all at once; CR before LF is dropped, empty lines too."""
    data = b''.join(line + b'\r\n' for line in lines) + b'half'
    splitter = LineSplitter()
    got = [line for k in range(0, len(data), size) for line in splitter.feed(data[k:k + size])]
    assert got == [line for line in lines if line]
    assert splitter.feed(b' done\n') == [b'half done']


@pytest.mark.parametrize('size', [1, 100, 10 * LONGEST])
def test_endless_line_is_dropped_once(size):
    """Memory stays bounded, and the line after it is read."""
    splitter = LineSplitter()
    data = b'x' * (5 * LONGEST) + b'\nnext\n'
    got = [line for k in range(0, len(data), size) for line in splitter.feed(data[k:k + size])]
    assert (got, splitter.overlong) == ([b'next'], 1)


# --- clock ------------------------------------------------------------------------------------

def test_clock_keeps_the_true_time_of_late_lines():
    """Lines that are held up by 0.3 s are stamped when they were read, across the wrap too."""
    clock, start = BoardClock(), 2**32 - 500_000
    for k in range(400):
        late = 0.3 if 100 <= k < 150 else 0.0
        taken = clock.time((start + k * 5000) % 2**32, 100.0 + k * 0.005 + late)
        assert taken == pytest.approx(100.0 + k * 0.005, abs=0.3 * DRIFT + 1e-6)


@pytest.mark.parametrize('rate', [0.995, 1.005])
def test_clock_follows_a_resonator_that_is_off(rate):
    """Half a percent fast or slow, for ten minutes: never late by more than a millisecond."""
    clock = BoardClock()
    worst = max(abs(clock.time(round(k * 5000 * rate) % 2**32, k * 0.005) - k * 0.005)
                for k in range(120_000))
    assert worst < 1e-3


@given(st.lists(st.floats(0.0, 0.5), min_size=2, max_size=50))
def test_clock_is_never_ahead(delays):
    """No reading is taken after it came, whatever the delays."""
    clock = BoardClock()
    for k, delay in enumerate(delays):
        received = 10.0 + 0.01 * k + delay
        assert clock.time(k * 10_000, received) <= received + 1e-9


# --- air --------------------------------------------------------------------------------------

@pytest.fixture
def air():
    """Return the air of two motor units, with the supply allowed at 0 s."""
    air = Air(2, command_timeout=0.1, supply_timeout=0.5)
    air.enable(True, 0.0)
    return air


def test_supply_shut_means_all_exhaust(air):
    """False, silence and any other reason to stop overrule fresh commands."""
    air.command(0, 1.0, 0.0, 0.0)
    air.command(1, 0.5, 0.0, 0.0)
    assert air.order(0.0) == Order(True, (1.0, 0.5), 0.0, '')
    assert air.order(0.0, 'stopped') == Order(False, (-1.0, -1.0), None, 'stopped')
    air.enable(False, 0.05)
    assert air.order(0.06).valves == (-1.0, -1.0)
    assert air.order(0.06).why == 'supply_enable is false'


def test_supply_is_shut_after_the_timeout_and_not_before(air):
    """At 0.5 s still open, after it shut."""
    assert air.order(0.5).supply
    assert not air.order(0.501).supply


def test_each_command_ages_by_the_reading_that_it_answers(air):
    """The order's age is that of the oldest command in use; a stale one is vented."""
    assert air.command(0, 0.3, 0.02, 0.05)
    assert air.command(1, 0.4, 0.04, 0.05)
    assert air.order(0.06).answers == 0.02
    assert air.order(0.13).valves == (-1.0, 0.4)
    assert air.order(0.13).answers == 0.04
    assert air.stale(0.13) == (0,)
    assert air.order(0.15).answers is None
    assert not air.command(0, 1.0, 0.02, 0.13)


def test_command_from_the_future_counts_from_when_it_came(air):
    """A controller whose clock runs ahead and that dies leaves no valve open."""
    assert air.command(0, 1.0, 3600.0, 0.0)
    assert air.order(0.1).valves[0] == 1.0
    assert air.order(0.11).valves[0] == -1.0


def test_false_of_another_publisher_holds_for_a_while(air):
    """True counts again when no false was heard for the time-out, or there is one publisher."""
    air.enable(False, 1.0, publishers=2)
    air.enable(True, 1.1, publishers=2)
    assert not air.order(1.1).supply
    air.enable(True, 1.2, publishers=1)
    assert air.order(1.2).supply
    air.enable(False, 2.0, publishers=2)
    air.enable(True, 2.5, publishers=2)
    assert air.order(2.5).supply


# --- conversation -----------------------------------------------------------------------------

class Talking:
    """A board of one motor unit that has said hello."""

    def __init__(self):
        self.lost = []
        self.board = Board(1, 0.5, self.lost.append)
        self.board.opened()
        self.say('H,1,1,x', 0.0)

    def say(self, body, now):
        return self.board.feed(frame(body), now)

    def sample(self, number, now, command=0):
        return self.say(f'S,{number},{round(now * 1e6)},{command},0,0,1,2,3,4', now)


@pytest.fixture
def talking():
    """Return a conversation under way."""
    return Talking()


def test_lost_lines_are_counted_by_their_numbers(talking):
    """Across the wrap of the counter too."""
    for now, number in enumerate((2**32 - 3, 2**32 - 2, 1, 2)):
        assert len(talking.sample(number, float(now))) == 1
    assert (talking.board.lost, talking.lost) == (2, [])


def test_samples_before_the_greeting_are_worth_nothing():
    """Nobody knows yet what their fields mean."""
    board = Board(1, 0.5, print)
    board.opened()
    assert board.feed(frame('S,1,2,0,0,0,1,2,3,4'), 0.0) == []
    assert board.talk is Talk.GREETING
    assert board.newest is None


def test_greeting_is_repeated_until_answered(talking):
    """Four times a second: a board that was just opened may be starting."""
    board = Board(1, 0.5, print)
    assert not board.greeting_due(0.0)
    board.opened()
    assert [t for t in range(100) if board.greeting_due(t * 0.01)] == [0, 25, 50, 75]
    assert not talking.board.greeting_due(1.0)


def test_counter_that_goes_back_is_a_restart(talking):
    """The board is greeted again, and what it was told before is forgotten."""
    talking.sample(100, 0.0)
    assert talking.sample(0, 0.01) == []
    assert (talking.lost, talking.board.talk) == (['the board has restarted'], Talk.GREETING)
    talking.say('H,1,1,x', 0.02)
    assert len(talking.sample(1, 0.03)) == 1


def test_same_number_twice_is_garbled(talking):
    """A counter that stands still would hide lost lines."""
    talking.sample(1, 0.0)
    assert talking.sample(1, 0.01) == []
    assert talking.board.garbled == 1


def test_wrong_number_of_pressures_is_garbled(talking):
    """Channels would go to the wrong motor units."""
    assert talking.say('S,1,2,0,0,0,1,2,3,4,5', 0.0) == []
    assert talking.board.garbled == 1


def test_silence_loses_the_board(talking):
    """After the time-out, once; not before."""
    talking.sample(1, 0.0)
    talking.board.check(0.5)
    assert talking.board.running
    talking.board.check(0.51)
    talking.board.check(0.6)
    assert talking.lost == ['the board was silent for 0.51 s']


def test_board_that_answers_no_command_is_deaf(talking):
    """Samples that echo an old command show that new ones do not arrive."""
    talking.board.sent(1, 0.0)
    talking.sample(1, 0.1, command=1)
    assert talking.board.round_trip == pytest.approx(0.1)
    for k in range(1, 10):
        talking.board.sent(k + 1, 0.05 * k)
        talking.sample(k + 1, 0.1 + 0.05 * k, command=1)
    assert talking.board.deaf == 'the board has taken no command for 0.55 s'
    talking.sample(20, 0.6, command=10)
    assert talking.board.deaf == ''


def test_ticks_are_those_of_the_board(talking):
    """Of a time before the newest sample; never of one after it."""
    talking.sample(1, 10.0)
    talking.sample(2, 10.1)
    assert talking.board.ticks(10.05) == pytest.approx(10_050_000, abs=1_100)
    assert talking.board.ticks(11.0) == 10_100_000


def test_first_lines_that_come_at_once_are_one_sample(talking):
    """Nothing tells yet when they were read: stamps must differ, so only one is given on."""
    data = b''.join(frame(f'S,{k},{5000 * k},0,0,0,1,2,3,4') for k in (1, 2, 3))
    assert [sample.number for sample, _ in talking.board.feed(data, 1.0)] == [1]
    assert (talking.board.skipped, talking.board.lost) == (2, 0)
    (_, taken), = talking.sample(4, 1.1)
    assert taken > 1.0


def test_clock_of_a_board_that_comes_back_is_followed_anew(talking):
    """It may have restarted while nobody listened, and its clock with it."""
    talking.sample(1, 10.0)
    talking.board.closed('unplugged')
    assert talking.lost == ['unplugged']
    talking.board.opened()
    talking.say('H,1,1,x', 70.0)
    (_, taken), = talking.say('S,1,15000000,0,0,0,1,2,3,4', 70.0)
    assert taken == 70.0
