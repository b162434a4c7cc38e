# Sums up the output of `cargo test` and of pytest, a line for each program: what passed, failed with names, or died, and
# its time; of what failed, the command that runs it alone. Exit code 1 if anything failed or died, or nothing was run.

function close_program() {
  if (program == "") return
  if (result == "") {
    sub(/^ +/, "", last)
    report("died", program, (ended == "" ? "it ended without a result" : ended) (running == "" ? "" : "; not finished:" running) "; its last line: " last)
    died++
  }
  program = ""
}
# The command for each of the tests that failed, by how cargo names the program that has them.
function alone(names, n, i, name, which) {
  which = program
  sub(/\.rs$/, "", which)
  if (sub(/^tests\//, "--test ", which)) ;
  else if (which ~ / library$/) which = "--lib"
  else if (which ~ /^Doc-tests/) which = "--doc"
  else which = "--bin " (which == "src/main" ? "insonify" : which)
  n = split(names, name, " ")
  for (i = 1; i <= n; i++) report("  alone", "", "cargo test --features anatomy " which " -- --exact " name[i])
}
function report(state, name, text) { lines[++count] = sprintf("%-7s %-34s %s", state, name, text) }

/^ +Running .*\(.*\)$/ || /^ +Doc-tests / {
  close_program()
  program = $0
  sub(/^ +(Running (unittests )?)?/, "", program)
  # Of a library its name, as each package has a lib.rs.
  if (program ~ /lib\.rs \(/) { sub(/^.*\//, "", program); sub(/-[0-9a-f]+\)$/, " library", program) }
  sub(/ \([^(]*\)$/, "", program)
  result = names = last = ended = running = ""
  next
}
program != "" && /^test .* \.\.\. FAILED$/ { names = names " " $2 }
# With several threads a test's name and its result may stand apart from each other.
program != "" && /^---- .* stdout ----$/ && index(names " ", " " $2 " ") == 0 { names = names " " $2 }
program != "" && /^test .* has been running for over 60 seconds$/ { running = running " " $2 }
program != "" && /^test result: / {
  result = $0
  match(result, /[0-9]+ passed/); passes = substr(result, RSTART, RLENGTH) + 0
  match(result, /[0-9]+ failed/); fails = substr(result, RSTART, RLENGTH) + 0
  match(result, /finished in [0-9.]+/); seconds = substr(result, RSTART + 12, RLENGTH - 12)
  passed += passes; failed += fails
  if (fails) {
    report("failed", program, fails " of " (passes + fails) ":" names ", " seconds " s")
    alone(names)
  }
  else if (passes) report("passed", program, passes ", " seconds " s")
  next
}
/^  process didn't exit successfully: .*\(/ {
  how = $0
  sub(/^.*\(/, "", how); sub(/\)$/, "", how)
  if (how ~ /signal|SIG/) {
    # Told after the program's output, before the next one starts.
    if (program != "" && result == "") ended = how
  }
  next
}
/^error: could not compile/ { report("failed", "the build", $0); failed++ }
# pytest's last line: "80 passed, 2 skipped in 81.20s (0:01:21)".
/^(=+ )?([0-9]+ [a-z]+, )*[0-9]+ [a-z]+ in [0-9.]+s/ {
  close_program()
  n = match($0, /[0-9]+ failed/) ? substr($0, RSTART, RLENGTH) + 0 : 0
  n += match($0, /[0-9]+ errors?/) ? substr($0, RSTART, RLENGTH) + 0 : 0
  n_passed = match($0, /[0-9]+ passed/) ? substr($0, RSTART, RLENGTH) + 0 : 0
  failed += n; passed += n_passed
  gsub(/=/, "")
  report(n ? "failed" : "passed", "python/tests", $0 (n ? pytest : ""))
}
/^(FAILED|ERROR) .*\.py/ { pytest = pytest " " $2 }
/^SKIPPED \[/ { sub(/^SKIPPED \[[0-9]+\] /, ""); sub(/: (Skipped: )?(skipped: )?/, ", "); report("skipped", "python/tests", $0) }
program != "" && NF && !/^(error: |Caused by:|test .* \.\.\. ok$)/ { last = $0 }

END {
  close_program()
  for (i = 1; i <= count; i++) print lines[i]
  printf "in all  %d passed, %d failed, %d programs died\n", passed, failed, died
  exit (failed || died || !passed)
}
