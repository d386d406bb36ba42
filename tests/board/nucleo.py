"""Runs the image of the NUCLEO-H743ZI2 under Unicorn, byte for byte the one that `proprio flash` writes, beside as much of the chip as it asks for.

    nucleo.py IMAGE SECONDS EVENTS [no-hse] [rsr=HEX] [bor=LEVEL] [count]

EVENTS has lines `time_us line hex`: what a line brings without a pause until then, lines 0 to 3 being the buses of the legs and 4 the host;
`!2` in place of the bytes is a framing error, `!8` an overrun, `dma` an error of the line's DMA; `power` cuts the power for a moment, and `torn` does
while a word of the flash is written. `rsr` is what RCC_RSR says of the reset, the power's coming unless given, and `bor` the option bytes' BOR_LEV. Lines of standard output are `time_us hex`, what the board says to the host; the last is a JSON
object: what the watchdog was told, which lights were lit when (µs), what its starts were, with `count` the instructions of each interrupt, and how the
run ended. A reset by the firmware or the watchdog begins the image anew, with RAM as it was.

The registers are those of RM0433, by their names in it. One instruction is taken for one cycle of 400 MHz: what this cannot show are times, the
cache and everything electrical. A register that is not modelled keeps what is written to it.
"""

import json
import struct
import sys

from elftools.elf.elffile import ELFFile
from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_HOOK_INTR, UC_HOOK_MEM_INVALID, UC_HOOK_MEM_READ, UC_HOOK_MEM_WRITE, UC_MODE_THUMB, Uc, UcError
from unicorn import arm_const as arm

CORE_HZ = 400_000_000
TIMER_HZ = 200_000_000
# PCLK1, of which the UARTs' bit rates are.
KERNEL_HZ = 100_000_000
MEMORY = [(0x0800_0000, 2 << 20), (0x2000_0000, 128 << 10), (0x2400_0000, 512 << 10), (0x3000_0000, 320 << 10), (0x3800_0000, 64 << 10), (0x1FF0_0000, 128 << 10)]
PERIPHERALS = [(0x4000_0000, 0x40000), (0x5000_0000, 0x10000), (0x5200_0000, 0x10000), (0x5800_0000, 0x40000), (0x5C00_0000, 0x10000), (0xE000_0000, 0x100000)]
BANK2 = 0x0810_0000
SECTOR = 128 << 10

# The first port; and interrupts of the vector table (RM0433, table of the NVIC).
GPIO, VECTORS = 0x5802_0000, 150
RCC, PWR, FLASH, DMA1, TIM5, IWDG1 = 0x5802_4400, 0x5802_4800, 0x5200_2000, 0x4002_0000, 0x4000_0C00, 0x5800_4800
# USART2, UART4, UART5, UART7, USART3: the buses and the host, and their interrupts.
UARTS = [(0x4000_4400, 38), (0x4000_4C00, 52), (0x4000_5000, 53), (0x4000_7800, 82), (0x4000_4800, 39)]
STREAM_IRQ = [11, 12, 13, 14, 15, 16, 17, 47]
STREAM_SHIFT = [0, 6, 16, 22]
TIM5_IRQ, FLASH_IRQ = 50, 4
# Bits of RCC_CR: an oscillator or PLL that is switched on, and that it is ready.
HSE = (16, 17)
READY = [(0, 2), (7, 8), (12, 13), (24, 25), (26, 27), (28, 29)]
# LD1, LD2, LD3: where a port's bits are set and reset (GPIOx_BSRR), and the pin.
# RCC_RSR when the power comes: POR, BOR, the pin, both domains, the core (RM0433, RCC_RSR).
POWER_ON = 1 << 23 | 1 << 22 | 1 << 21 | 1 << 20 | 1 << 19 | 1 << 17
PIN, SOFTWARE, WATCHDOG = 1 << 22 | 1 << 17, 1 << 24, 1 << 26
# FLASH_SRx.DBECCERR, and the core's CCR.BFHFNMIGN.
DOUBLE_ERROR, IGNORE_BUS_FAULTS = 1 << 26, 1 << 8
LSI_HZ = 32_000
# Interrupts of a kind whose instructions are counted, each by a hook that costs a millisecond: their costs differ by tens.
COUNTED = 200
LIGHTS = {"green": (0x5802_0418, 0), "yellow": (0x5802_1018, 1), "red": (0x5802_0418, 14)}
# Where an interrupt returns to.
RETURN = 0x1FF1_0000
SLICE = 4000


class Uart:
    """A UART whose bytes DMA takes and brings."""

    def __init__(self, base, irq):
        self.base, self.irq, self.isr, self.registers, self.received = base, irq, 0xC0, {}, 0

    def wants_interrupt(self):
        cr1, cr3 = self.registers.get(0, 0), self.registers.get(8, 0)
        enabled = (cr1 & 0x10) | (0x28 if cr1 & 0x20 else 0) | (cr1 & 0x40) | (cr1 & 0x80) | (0xE if cr3 & 1 else 0)
        return bool(self.isr & enabled)


class Stream:
    """A stream of DMA1."""

    def __init__(self, number):
        self.number, self.cr, self.ndtr, self.length, self.par, self.m0ar = number, 0, 0, 0, 0, 0


class Timer:
    """TIM5, which keeps the time."""

    def __init__(self):
        self.registers, self.counted, self.since, self.seen = {0x2C: 0xFFFF_FFFF}, 0, 0, 0

    def count(self, now):
        if not self.registers.get(0, 0) & 1:
            return self.counted
        ticks = (now - self.since) * TIMER_HZ // CORE_HZ // (self.registers.get(0x28, 0) + 1)
        return (self.counted + ticks) & self.registers[0x2C]

    def update(self, now):
        """Sets the flags of what has passed; whether an interrupt is due."""
        count = self.count(now)
        flags = self.registers.get(0x10, 0)
        for n in range(4):
            at = self.registers.get(0x34 + 4 * n, 0)
            if self.seen < at <= count or (count < self.seen and (at > self.seen or at <= count)):
                flags |= 2 << n
        self.registers[0x10] = flags | (count < self.seen)
        self.seen = count
        return bool(self.registers[0x10] & self.registers.get(0xC, 0) & 0x1F)


class Board:
    """The chip, and what is around it."""

    def __init__(self, image, hse, rsr, bor):
        self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB, cpu=arm.UC_CPU_ARM_CORTEX_M7)
        self.hse, self.rsr, self.bor, self.now, self.pc = hse, rsr, bor, 0, 0
        self.begin()
        self.ended, self.reset, self.starts = None, None, []
        self.watchdog, self.keys_before_clocks, self.interrupts, self.erased = [], None, 0, 0
        self.lit, self.shown = set(), []
        self.written, self.torn, self.bus_error = None, set(), False
        self.counting, self.hook, self.instructions, self.costs = False, None, 0, {}
        for base, size in MEMORY:
            self.uc.mem_map(base, size)
        self.uc.mem_write(0x0800_0000, b"\xff" * (2 << 20))
        self.uc.mem_write(RETURN, b"\x00\xbf" * 8)
        for base, size in PERIPHERALS:
            self.uc.mmio_map(base, size, self.read, base, self.write, base)
        self.load(image)

    def begin(self):
        """The chip as a reset leaves it, but for its memories."""
        self.registers, self.enabled, self.pending, self.nested = {}, [0] * 8, set(), []
        self.uarts = [Uart(*place) for place in UARTS]
        self.uart_at = {uart.base: uart for uart in self.uarts}
        self.streams = [Stream(n) for n in range(8)]
        self.dma_flags = [0, 0]
        self.timer = Timer()
        self.asleep, self.watchdog_due = False, None

    def start(self):
        """The core's first instruction."""
        self.begin()
        stack, self.pc = struct.unpack("<II", self.uc.mem_read(0x0800_0000, 8))
        self.uc.reg_write(arm.UC_ARM_REG_SP, stack)
        self.uc.reg_write(arm.UC_ARM_REG_PRIMASK, 0)
        self.uc.reg_write(arm.UC_ARM_REG_FPEXC, 1 << 30)
        self.starts.append([self.now * 1_000_000 // CORE_HZ, f"{self.rsr:x}"])

    def start_anew(self):
        """After a reset, whose flags are in `reset`; none where the power was off."""
        if self.hook is not None:
            self.uncount()
        self.rsr = self.rsr | PIN | self.reset if self.reset else POWER_ON
        if not self.reset:
            for base, size in MEMORY[1:5]:
                self.uc.mem_write(base, b"\xa5" * size)
        self.reset = None
        self.start()

    def load(self, image):
        with open(image, "rb") as file:
            elf = ELFFile(file)
            for segment in elf.iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                    self.uc.mem_write(segment["p_paddr"], segment.data())
            text = elf.get_section_by_name(".text")
            code, start = text.data(), text["sh_addr"]
        # wfe and wfi end a slice.
        for at in range(0, len(code) - 1, 2):
            if code[at : at + 2] in (b"\x20\xbf", b"\x30\xbf"):
                self.uc.hook_add(UC_HOOK_CODE, self.sleep, begin=start + at, end=start + at)
        self.uc.hook_add(UC_HOOK_CODE, lambda uc, *_: uc.emu_stop(), begin=RETURN, end=RETURN)
        self.uc.hook_add(UC_HOOK_MEM_INVALID, self.fault)
        self.uc.hook_add(UC_HOOK_INTR, self.exception)
        self.uc.hook_add(UC_HOOK_MEM_WRITE, self.program, begin=BANK2, end=BANK2 + 8 * SECTOR - 1)
        self.start()

    def sleep(self, uc, *_):
        self.asleep = True
        uc.emu_stop()

    def fault(self, uc, kind, address, *_):
        self.ended = f"access {kind} to {address:#x} at {uc.reg_read(arm.UC_ARM_REG_PC):#x}"
        return False

    def exception(self, uc, number, _):
        self.ended = f"exception {number} at {uc.reg_read(arm.UC_ARM_REG_PC):#x}"
        uc.emu_stop()

    # Flash: the second bank is erased and written while the first is executed from.

    def program(self, _uc, _kind, address, _size, _value, _):
        self.written = address & ~31
        self.flash_done(0x100)

    def tear(self):
        """The power fails while the last word that was begun is written: what it has is not what its checksum is of (RM0433, error correction of the flash)."""
        if self.written is None:
            return
        self.torn.add(self.written)
        self.uc.mem_write(self.written + 16, b"\xff" * 16)
        self.uc.hook_add(UC_HOOK_MEM_READ, self.read_torn, begin=self.written, end=self.written + 31)

    def read_torn(self, uc, _kind, address, *_):
        if address & ~31 not in self.torn:
            return
        status = FLASH + 0x110
        self.registers[status] = self.registers.get(status, 0) | DOUBLE_ERROR
        masked = uc.reg_read(arm.UC_ARM_REG_FAULTMASK) or uc.reg_read(arm.UC_ARM_REG_PRIMASK)
        if not (self.registers.get(0xE000_ED14, 0) & IGNORE_BUS_FAULTS and masked):
            self.ended = f"bus fault: a torn word is read at {uc.reg_read(arm.UC_ARM_REG_PC):#x}"
            uc.emu_stop()

    def flash_done(self, bank):
        status, control = FLASH + bank + 0x10, FLASH + bank + 0x0C
        self.registers[status] = self.registers.get(status, 0) | 1 << 16
        if self.registers.get(control, 0) >> 16 & 1:
            self.pending.add(FLASH_IRQ)

    def flash_control(self, bank, value):
        self.registers[FLASH + bank + 0x0C] = value & ~(1 << 7)
        if value >> 7 & 1 and value >> 2 & 1:
            start = 0x0800_0000 + (BANK2 - 0x0800_0000 if bank else 0) + (value >> 8 & 7) * SECTOR
            self.uc.mem_write(start, b"\xff" * SECTOR)
            self.torn = {word for word in self.torn if not start <= word < start + SECTOR}
            self.erased += 1
            self.flash_done(bank)

    # Lines and DMA.

    def dma_flag(self, stream, bits):
        self.dma_flags[stream.number // 4] |= bits << STREAM_SHIFT[stream.number % 4]
        if (bits & 0x20 and stream.cr & 0x10) or (bits & 0x10 and stream.cr & 8) or (bits & 8 and stream.cr & 4):
            self.pending.add(STREAM_IRQ[stream.number])

    def bring(self, line, data):
        """What a line brings; then it is idle."""
        uart = self.uarts[line]
        if not uart.registers.get(0, 0) & 4:
            return
        uart.received = data[-1]
        stream = next((s for s in self.streams if s.cr & 1 and s.par == uart.base + 0x24), None)
        if stream is None:
            uart.isr |= 0x20
        while stream and data:
            # As far as half of the buffer, or all of it.
            half = stream.length // 2
            part = data[: stream.ndtr - half if stream.ndtr > half else stream.ndtr]
            self.uc.mem_write(stream.m0ar + stream.length - stream.ndtr, part)
            stream.ndtr, data = stream.ndtr - len(part), data[len(part) :]
            if stream.ndtr == half:
                self.dma_flag(stream, 0x10)
            if stream.ndtr == 0:
                self.dma_flag(stream, 0x20)
                if not stream.cr & 0x100:
                    break
                stream.ndtr = stream.length
        self.raise_flags(uart, 0x10)

    def dma_error(self, line):
        """A transfer error: the stream stops itself."""
        stream = next((s for s in self.streams if s.cr & 1 and s.par == self.uarts[line].base + 0x24), None)
        if stream:
            stream.cr &= ~1
            self.dma_flag(stream, 8)

    def raise_flags(self, uart, flags):
        uart.isr |= flags
        if uart.wants_interrupt():
            self.pending.add(uart.irq)

    def send(self, uart):
        """What the board says, at once."""
        stream = next((s for s in self.streams if s.cr & 1 and s.ndtr and s.par == uart.base + 0x28), None)
        if stream is None or not uart.registers.get(8, 0) & 0x80:
            return
        said = bytes(self.uc.mem_read(stream.m0ar, stream.ndtr))
        print(f"{self.now * 1_000_000 // CORE_HZ} {said.hex()}", flush=True)
        stream.ndtr, stream.cr = 0, stream.cr & ~1
        self.dma_flag(stream, 0x20)
        self.raise_flags(uart, 0xC0)

    # Registers.

    def read(self, _uc, offset, size, base):
        address = base + offset
        value = self.read_word(address & ~3)
        return value >> 8 * (address & 3) & ((1 << 8 * size) - 1)

    def read_word(self, address):
        value = self.registers.get(address, 0)
        if address == RCC:
            for on, ready in READY + ([HSE] if self.hse else []):
                value = value | 1 << ready if value >> on & 1 else value & ~(1 << ready)
            return value
        if address == RCC + 0x10:  # CFGR: the switch is where it is set
            return value & ~0x38 | (value & 7) << 3
        if address in (RCC + 0x70, RCC + 0x74):  # BDCR, CSR: oscillators
            return value & ~2 | (value & 1) << 1
        if address == RCC + 0xD0:  # RSR
            return self.rsr
        if address == FLASH + 0x1C:  # OPTSR_CUR
            return self.bor << 2
        if address == PWR + 0x04:  # CSR1: voltage is ready
            return 1 << 13 | self.registers.get(PWR + 0x18, 0xC000) & 0xC000
        if address == PWR + 0x0C:
            return self.registers.get(address, 6)
        if address == PWR + 0x18:  # D3CR
            return self.registers.get(address, 0xC000) | 1 << 13
        if address == 0x5C00_1000:  # DBGMCU_IDC: revision V
            return 0x2003_6450
        uart = self.uart_at.get(address & ~0x3FF)
        if uart:
            register = address - uart.base
            if register == 0x1C:
                cr1 = uart.registers.get(0, 0)
                return uart.isr | (cr1 >> 2 & 1) << 22 | (cr1 >> 3 & 1) << 21
            if register == 0x24:
                uart.isr &= ~0x20
                return uart.received
            return uart.registers.get(register, 0)
        if DMA1 <= address < DMA1 + 0xD0:
            register = address - DMA1
            if register < 8:
                return self.dma_flags[register // 4]
            if register < 0x10:
                return 0
            stream = self.streams[(register - 0x10) // 0x18]
            return [stream.cr, stream.ndtr, stream.par, stream.m0ar, 0, 0x21][(register - 0x10) % 0x18 // 4]
        if TIM5 <= address < TIM5 + 0x400:
            register = address - TIM5
            return self.timer.count(self.now) if register == 0x24 else self.timer.registers.get(register, 0)
        if address == 0xE000_1004:  # DWT_CYCCNT
            return self.now & 0xFFFF_FFFF
        if 0xE000_E100 <= address < 0xE000_E120:
            return self.enabled[(address - 0xE000_E100) // 4]
        if address == 0xE000_ED00:  # CPUID: Cortex-M7
            return 0x411F_C271
        if address == 0xE000_ED0C:
            return 0xFA05_0000 | value & 0x700
        return value

    def write(self, _uc, offset, size, value, base):
        address = base + offset
        word = address & ~3
        if size < 4:
            mask, shift = (1 << 8 * size) - 1, 8 * (address & 3)
            value = self.registers.get(word, 0) & ~(mask << shift) | (value & mask) << shift
        self.write_word(word, value)

    def write_word(self, address, value):
        uart = self.uart_at.get(address & ~0x3FF)
        if uart:
            register = address - uart.base
            if register == 0x20:
                uart.isr &= ~(value & 0x5F)
            else:
                uart.registers[register] = value
                self.send(uart)
                self.raise_flags(uart, 0)
        elif DMA1 <= address < DMA1 + 0xD0:
            self.write_dma(address - DMA1, value)
        elif TIM5 <= address < TIM5 + 0x400:
            self.write_timer(address - TIM5, value)
        elif 0xE000_E100 <= address < 0xE000_E300:
            self.write_nvic(address - 0xE000_E100, value)
        elif address == IWDG1:
            self.watchdog.append((self.now, value & 0xFFFF))
            if value & 0xFFFF in (0xAAAA, 0xCCCC):
                # Of the registers' first values, where it is not told otherwise (RM0433, IWDG_RLR).
                divisor, reload = 4 << (self.registers.get(IWDG1 + 4, 0) & 7), self.registers.get(IWDG1 + 8, 0xFFF)
                self.watchdog_due = self.now + (reload + 1) * divisor * CORE_HZ // LSI_HZ
        elif address in (FLASH + 0x0C, FLASH + 0x10C):
            self.flash_control(address - FLASH - 0x0C, value)
        elif address in (FLASH + 0x14, FLASH + 0x114):
            self.registers[address - 4] = self.registers.get(address - 4, 0) & ~value
        elif address == 0xE000_ED0C and value >> 16 == 0x05FA and value & 4:
            self.reset = SOFTWARE
            self.uc.emu_stop()
        else:
            if address == RCC and value >> 16 & 1 and self.keys_before_clocks is None:
                self.keys_before_clocks = [key for _, key in self.watchdog]
            if any(address == port for port, _ in LIGHTS.values()):
                self.light(address, value)
            if address == RCC + 0xD0 and value >> 16 & 1:  # RMVF
                self.rsr = 0
            self.registers[address] = value

    def light(self, address, value):
        """What is lit after a port's bits were written, which its GPIOx_ODR then shows."""
        output = self.registers.get(address - 4, 0)
        self.registers[address - 4] = output & ~(value >> 16) | value & 0xFFFF
        for name, (port, pin) in LIGHTS.items():
            if port == address and value >> pin & 1:
                self.lit.add(name)
            elif port == address and value >> pin + 16 & 1:
                self.lit.discard(name)
        self.shown.append((self.now * 1_000_000 // CORE_HZ, sorted(self.lit)))

    def write_dma(self, register, value):
        if register in (8, 12):
            self.dma_flags[(register - 8) // 4] &= ~value
            return
        if register < 0x10:
            return
        stream = self.streams[(register - 0x10) // 0x18]
        part = (register - 0x10) % 0x18 // 4
        if part == 0:
            if value & 1 and not stream.cr & 1:
                stream.length = stream.ndtr
            stream.cr = value
            for uart in self.uarts:
                self.send(uart)
        elif part == 1:
            stream.ndtr = value
        elif part == 2:
            stream.par = value
        elif part == 3:
            stream.m0ar = value

    def write_timer(self, register, value):
        timer = self.timer
        if register == 0x10:
            timer.registers[0x10] = timer.registers.get(0x10, 0) & value
            return
        if register in (0, 0x24, 0x28):
            timer.counted, timer.since = timer.count(self.now), self.now
        if register == 0x24 or (register == 0x14 and value & 1):
            timer.counted, timer.since = (value if register == 0x24 else 0), self.now
            timer.seen = timer.counted
        if register == 0x14 and value & 1:
            timer.registers[0x10] = timer.registers.get(0x10, 0) | 1
        timer.registers[register] = value

    def write_nvic(self, register, value):
        word = register % 0x80 // 4
        bits = [32 * word + n for n in range(32) if value >> n & 1]
        if register < 0x80:
            self.enabled[word] |= value
        elif register < 0x100:
            self.enabled[word] &= ~value
        elif register < 0x180:
            self.pending.update(bits)
        else:
            self.pending.difference_update(bits)

    # Interrupts.

    def next_interrupt(self):
        """The most urgent that may come now, and its priority."""
        running = self.nested[-1][2] if self.nested else 256
        due = []
        for number in self.pending:
            if self.enabled[number // 32] >> number % 32 & 1:
                word = self.registers.get(0xE000_E400 + (number & ~3), 0)
                due.append((word >> 8 * (number & 3) & 0xFF, number))
        first = min(due, default=None)
        return first if first and first[0] < running and not self.uc.reg_read(arm.UC_ARM_REG_PRIMASK) else None

    def enter(self, priority, number):
        self.pending.discard(number)
        self.interrupts += 1
        # All registers, where the core stacks those that a function may change.
        kept = self.uc.context_save()
        self.nested.append((kept, self.pc, priority, number, self.instructions))
        if self.counting and self.hook is None and len(self.costs.get(number, ())) < COUNTED:
            self.hook = self.uc.hook_add(UC_HOOK_CODE, self.count, begin=0x0800_0000, end=BANK2 - 1)
        self.uc.reg_write(arm.UC_ARM_REG_SP, (self.uc.reg_read(arm.UC_ARM_REG_SP) - 104) & ~7)
        self.uc.reg_write(arm.UC_ARM_REG_LR, RETURN | 1)
        (self.pc,) = struct.unpack("<I", self.uc.mem_read(0x0800_0000 + 64 + 4 * number, 4))

    def leave(self):
        kept, self.pc, _, number, before = self.nested.pop()
        if self.hook is not None:
            self.costs.setdefault(number, []).append(self.instructions - before)
            if not self.nested:
                self.uncount()
        self.uc.context_restore(kept)
        # A line that is still raised interrupts again.
        for uart in self.uarts:
            if uart.irq == number:
                self.raise_flags(uart, 0)

    def count(self, *_):
        self.instructions += 1

    def uncount(self):
        self.uc.hook_del(self.hook)
        self.hook = None

    def happen(self, line, what):
        """An event of `EVENTS`."""
        if isinstance(what, bytes):
            self.bring(line, what)
        elif isinstance(what, int):
            self.raise_flags(self.uarts[line], what)
        elif what == "dma":
            self.dma_error(line)
        else:
            if what == "torn":
                self.tear()
            self.reset = 0

    def run(self, seconds, events):
        done = 0
        while self.now < seconds * CORE_HZ and not self.ended:
            while done < len(events) and events[done][0] <= self.now:
                _, line, what = events[done]
                done += 1
                self.happen(line, what)
            if self.watchdog_due is not None and self.now > self.watchdog_due:
                self.reset = WATCHDOG
            if self.reset is not None:
                self.start_anew()
            if self.timer.update(self.now):
                self.pending.add(TIM5_IRQ)
            interrupt = self.next_interrupt()
            if interrupt:
                self.enter(*interrupt)
                self.asleep = False
            if self.asleep:
                self.wait(events[done][0] if done < len(events) else None)
                continue
            try:
                self.uc.emu_start(self.pc | 1, 0xFFFF_FFFE, count=SLICE)
            except UcError as error:
                self.ended = self.ended or str(error)
            self.pc = self.uc.reg_read(arm.UC_ARM_REG_PC)
            if self.asleep:
                self.pc += 2
                self.now += SLICE // 4
            elif self.pc & ~1 == RETURN:
                self.leave()
                self.now += SLICE // 8
            else:
                self.now += SLICE

    def wait(self, event):
        """Until something may wake the core."""
        until = self.now + CORE_HZ // 1000
        if event is not None:
            until = min(until, max(event, self.now + 400))
        count = self.timer.count(self.now)
        for n in range(4):
            if self.timer.registers.get(0xC, 0) >> n + 1 & 1:
                ticks = (self.timer.registers.get(0x34 + 4 * n, 0) - count) & 0xFFFF_FFFF
                cycles = ticks * (self.timer.registers.get(0x28, 0) + 1) * CORE_HZ // TIMER_HZ
                until = min(until, self.now + max(400, cycles))
        self.now, self.asleep = until, False

    def baud(self, uart):
        """Bits per second by BRR and CR1.OVER8, of the kernel clock that all have (RM0433, USART_BRR)."""
        brr, over8 = uart.registers.get(0x0C, 0), uart.registers.get(0, 0) >> 15 & 1
        divider = brr & ~0xF | (brr & 7) << 1 if over8 else brr
        return KERNEL_HZ * (1 + over8) // divider if divider else 0

    def pins(self):
        """Pins that are a peripheral's, by name, with their alternate function (RM0433, GPIOx_MODER and GPIOx_AFRL)."""
        functions = {}
        for port in range(11):
            base = GPIO + 0x400 * port
            mode, low, high = (self.registers.get(base + at, 0) for at in (0, 0x20, 0x24))
            for pin in range(16):
                if mode >> 2 * pin & 3 == 2:
                    functions[f"P{chr(ord('A') + port)}{pin}"] = (high << 32 | low) >> 4 * pin & 15
        return functions

    def handled(self):
        """Interrupts whose vector is not that of most."""
        vectors = struct.unpack(f"<{VECTORS}I", self.uc.mem_read(0x0800_0000 + 4 * 16, 4 * VECTORS))
        return [number for number, vector in enumerate(vectors) if vector != max(vectors, key=vectors.count)]

    def report(self):
        pets = [at for at, key in self.watchdog if key == 0xAAAA]
        pauses = [after - before for before, after in zip(pets, pets[1:])]
        return {
            "ended": self.ended,
            "watchdog_before_clocks": 0xCCCC in (self.keys_before_clocks or []),
            "pets": len(pets),
            "longest_pause_ms": max(pauses, default=0) / CORE_HZ * 1e3,
            "interrupts": self.interrupts,
            "interrupt_instructions": {number: [len(costs), sum(costs) / len(costs), max(costs)] for number, costs in self.costs.items()},
            "starts": self.starts,
            "sectors_erased": self.erased,
            "pins": self.pins(),
            "handled": self.handled(),
            # CR1.TE.
            "transmits": [bool(uart.registers.get(0, 0) & 8) for uart in self.uarts],
            "buses_baud": [self.baud(uart) for uart in self.uarts[:4]],
            "lights": self.shown,
        }


def main():
    image, seconds, events = sys.argv[1:4]
    given = dict(argument.partition("=")[::2] for argument in sys.argv[4:])
    board = Board(image, hse="no-hse" not in given, rsr=int(given.get("rsr", f"{POWER_ON:x}"), 16), bor=int(given.get("bor", "0")))
    board.counting = "count" in given
    lines = []
    with open(events) as file:
        for line in file:
            time_us, bus, what = line.split()
            if what.startswith("!"):
                what = int(what[1:])
            elif what not in ("dma", "power", "torn"):
                what = bytes.fromhex(what)
            lines.append((int(float(time_us) * CORE_HZ / 1e6), int(bus), what))
    lines.sort(key=lambda line: line[0])
    board.run(float(seconds), lines)
    print(json.dumps(board.report()))


main()
