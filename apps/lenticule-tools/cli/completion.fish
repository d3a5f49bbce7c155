# fish completion for lenticule

# What may follow a command, or a flag behind its command: PLACE:WORDS:FLAGS:DESCRIPTION.
set -g __lenticule_table (string split \n '@table@')

# Prints what the table has at a place.
function __lenticule_row
    set -l rows (string match -- "$argv[1]:*" $__lenticule_table); or return
    string split -m 3 : -- $rows[1] | tail -n 3
end

function __lenticule_next
    set -l words (commandline -opc)[2..-1]
    set -l command lenticule
    set -l row (__lenticule_row lenticule)
    for word in $words
        if set row (__lenticule_row "$command $word")
            string match -q -- '-*' $word; or set command "$command $word"
        else
            set row (__lenticule_row $command)
        end
    end
    set -l next (string split -n ' ' -- $row[1])
    set -l flags (string split -n ' ' -- $row[2])
    # Another program has the command and knows what may follow.
    if test "$next" = '?'; and string match -q -- '-*' $words[-1]
        set next
    else if test "$next" = '?'
        set -l help (lenticule $words[1] (string match -rv '^-' -- $words[2]) --help 2>/dev/null)
        set next (string replace -rf '^  ([a-z][a-z-]*)  .*' '$1' -- $help)
        set flags (string replace -rf '^  (?:-.,)?(--[a-z-]+).*' '$1' -- $help)
    end
    if test -n "$flags"; and string match -q -- '-*' (commandline -ct)
        printf '%s\n' $flags
    else if test -n "$next"
        for word in $next
            set row (__lenticule_row "$command $word")
            printf '%s\t%s\n' $word "$row[3]"
        end
    else
        __fish_complete_path (commandline -ct)
    end
end

complete -c lenticule -f -a '(__lenticule_next)'
