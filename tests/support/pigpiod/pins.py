"""The daemon's GPIOs: levels and two kinds of PWM."""

from __future__ import annotations

PULLS = ("floating", "down", "up")
LAST_USER_GPIO = 31
HARDWARE_PWM = {12: 0, 18: 0, 13: 1, 19: 1}
PLLD_HZ = 750_000_000
"""Clock of a Pi 4. Hardware PWM has PLLD / 2 / frequency steps."""

BAD_GPIO = -3
BAD_PUD = -6
BAD_DUTYCYCLE = -8
BAD_DUTYRANGE = -21
NOT_HPWM_GPIO = -95
BAD_HPWM_FREQ = -96
BAD_HPWM_DUTY = -97
HPWM_ILLEGAL = -100
BAD_FILTER = -125

DMA_FREQUENCIES_HZ = (
    8000, 4000, 2000, 1600, 1000, 800, 500, 400, 320, 250, 200, 160, 100, 80, 50, 40, 20, 10,
)  # fmt: skip
"""The frequencies of DMA PWM at a sample rate of 5 us."""
DMA_STEPS = 200_000
"""Steps in a second: 25 at 8 kHz."""


class PinBank:
    """Args:
    pwm_is_clock: The daemon was started with `-t 0`.
    """

    def __init__(self, pwm_is_clock: bool) -> None:
        self.levels = 0
        """Levels of all GPIOs, one bit each."""
        self.pulls = [""] * (LAST_USER_GPIO + 1)
        """The pull of each GPIO, as it was last asked for."""
        self._pwm_is_clock = pwm_is_clock
        self._hardware: dict[int, tuple[int, int]] = {}
        self._dma_hz: dict[int, int] = {}
        self._dma_duty: dict[int, int] = {}
        self._dma_range: dict[int, int] = {}

    def set_mode(self, gpio: int) -> int:
        """Nothing depends on the mode: an output's level is that of its first write."""
        return BAD_GPIO if gpio > LAST_USER_GPIO else 0

    def set_pull(self, gpio: int, pull: int) -> int:
        if gpio > LAST_USER_GPIO:
            return BAD_GPIO
        if pull >= len(PULLS):
            return BAD_PUD
        self.pulls[gpio] = PULLS[pull]
        return 0

    def write(self, gpio: int, level: int) -> int:
        """A plain level ends any PWM on the GPIO."""
        if gpio > LAST_USER_GPIO:
            return BAD_GPIO
        self._hardware.pop(gpio, None)
        self._dma_duty.pop(gpio, None)
        bit = 1 << gpio
        self.levels = self.levels | bit if level else self.levels & ~bit
        return 0

    def hardware_pwm(self, gpio: int, frequency_hz: int, duty: int) -> int:
        if gpio not in HARDWARE_PWM:
            return NOT_HPWM_GPIO
        if duty > 1_000_000:
            return BAD_HPWM_DUTY
        if frequency_hz > 187_500_000:
            return BAD_HPWM_FREQ
        if self._pwm_is_clock:
            return HPWM_ILLEGAL
        self._hardware[gpio] = (frequency_hz, duty)
        return 0

    def set_dma_frequency(self, gpio: int, frequency_hz: int) -> int:
        """Set the nearest frequency available, without an error."""
        self._dma_hz[gpio] = min(DMA_FREQUENCIES_HZ, key=lambda there: abs(there - frequency_hz))
        return self._dma_hz[gpio]

    def dma_range(self, gpio: int) -> int:
        """The duty that is always on."""
        return self._dma_range.get(gpio, 255)

    def set_dma_range(self, gpio: int, full: int) -> int:
        """Set the duty that is always on; returns the steps that there are."""
        if not 25 <= full <= 40_000:
            return BAD_DUTYRANGE
        self._dma_range[gpio] = full
        return self.real_range(gpio)

    def set_dma_duty(self, gpio: int, duty: int) -> int:
        if not 0 <= duty <= self.dma_range(gpio):
            return BAD_DUTYCYCLE
        self._hardware.pop(gpio, None)
        self._dma_duty[gpio] = duty
        return 0

    def pwm_frequency(self, gpio: int) -> int:
        if gpio in self._hardware:
            return self._hardware[gpio][0]
        return self._dma_hz.get(gpio, 800)

    def real_range(self, gpio: int) -> int:
        if gpio in self._hardware:
            return PLLD_HZ // 2 // self._hardware[gpio][0]
        return DMA_STEPS // self.pwm_frequency(gpio)

    def enable(self, gpio: int) -> float:
        """The duty on an output, 0..1, rounded to the steps available."""
        steps = self.real_range(gpio)
        if gpio in self._hardware:
            return self._hardware[gpio][1] * steps // 1_000_000 / steps
        if gpio in self._dma_duty:
            return self._dma_duty[gpio] * steps // self.dma_range(gpio) / steps
        return float(self.level(gpio))

    def level(self, gpio: int) -> bool:
        return bool(self.levels >> gpio & 1)
