"""A scripted head on a line with a clock, for tests of the conversation: its faults are switches."""

from __future__ import annotations

from dataclasses import dataclass, field

from config.schema import Sonar
from drivers.tritech import commands
from drivers.tritech.framing import Deframer
from drivers.tritech.head import Head
from drivers.tritech.headdata import HeadData, HeadStatus
from drivers.tritech.messages import Alive, FpgaCalData, FpgaVersionData, HeadInf, VersionData, encode, user_block

MS = 1_000_000
SECOND = 1000 * MS
CENTRING, CENTRED, READY = HeadInf(0x5D), HeadInf(0x4A), HeadInf(0x8A)
SONAR = Sonar(bins=50)


@dataclass
class ScriptedHead:
    """A head that answers as the protocol says; its faults are switches."""

    parameters: commands.HeadParameters | None = None
    centres_at: int = 3 * SECOND
    pings_per_request: int = 2
    half_duplex: bool = False
    alives: bool = True
    answers_version: bool = True
    answers_block: bool = True
    takes_settings: bool = True
    dead: bool = False
    status: HeadStatus = HeadStatus.FULL_RANGE_8_BIT
    own_step: int | None = None
    period: int = 50 * MS
    log: list[commands.Command] = field(default_factory=list)
    queue: list[tuple[int, bytes]] = field(default_factory=list)
    pings: int = 0
    _deframer: Deframer = field(default_factory=Deframer)
    _alive_at: int = 0

    def count(self, kind: type[commands.Command]) -> int:
        return sum(isinstance(command, kind) for command in self.log)

    def run(self, t_ns: int, data: bytes) -> bytes:
        for frame in self._deframer.push(t_ns, data):
            command = commands.decode_command(frame)
            self.log.append(command)
            if not self.dead:
                self._obey(t_ns, command)
        if self.dead:
            return b""
        sent = b"".join(data for at, data in self.queue if at <= t_ns)
        self.queue = [each for each in self.queue if each[0] > t_ns]
        if t_ns >= self._alive_at and self.alives and not self.queue:
            self._alive_at = t_ns + SECOND
            info = READY if self.parameters else CENTRED if t_ns >= self.centres_at else CENTRING
            sent += encode(Alive(info))
        return sent

    def _obey(self, t_ns: int, command: commands.Command) -> None:
        match command:
            case commands.SendVersion() if self.answers_version:
                self.queue.append((t_ns + 10 * MS, encode(VersionData(0x31))))
            case commands.SendBBUser() if self.answers_block:
                reply = encode(user_block(half_duplex=self.half_duplex))
                self.queue.append(
                    (t_ns + 30 * MS, reply + encode(FpgaCalData(bytes(66))) + encode(FpgaVersionData(bytes(14))))
                )
            case commands.HeadCommand(parameters) if self.takes_settings:
                self.parameters = parameters
                self.status = HeadStatus.FULL_RANGE_8_BIT
                self._alive_at = t_ns + 300 * MS
            case commands.SendData():
                self._ping(t_ns)
            case commands.ReBoot():
                self.parameters, self.queue, self.takes_settings = None, [], True
                self.centres_at = t_ns + 3 * SECOND

    def _ping(self, t_ns: int) -> None:
        if self.parameters is None:
            return
        start = max([t_ns, *(at for at, _ in self.queue)])
        for number in range(self.pings_per_request):
            self.pings += 1
            self.queue.append((start + (number + 1) * self.period, self.ping(self.parameters)))

    def ping(self, wanted: commands.HeadParameters) -> bytes:
        data = HeadData(
            bearing=3200,
            bins=bytes(wanted.bins),
            ad_interval=wanted.ad_interval,
            step=self.own_step or wanted.step,
            left_limit=wanted.left_limit,
            right_limit=wanted.right_limit,
            control=wanted.control,
            status=self.status,
            gain=wanted.gain_1,
        )
        return encode(data)


class Line:
    """Both ends and a clock."""

    def __init__(self, scripted: ScriptedHead | None = None, sonar: Sonar = SONAR) -> None:
        self.head = Head(sonar)
        self.scripted = scripted or ScriptedHead()
        self.t_ns = 7 * SECOND * 1000
        self.scripted.centres_at += self.t_ns
        self.states: list[str] = []
        self._to_head = b""

    def run(self, seconds: float, drop_every: int = 0) -> Line:
        dropped = 0
        for _ in range(int(seconds * 100)):
            self.t_ns += 10 * MS
            data = self.scripted.run(self.t_ns, self._to_head)
            if data and drop_every:
                dropped += 1
                data = data if dropped % drop_every else data[: len(data) // 2] + data[len(data) // 2 + 5 :]
            self._to_head = self.head.push(self.t_ns, data) if data else self.head.tick(self.t_ns)
            if not self.states or self.states[-1] != self.head.state:
                self.states.append(self.head.state)
        return self
